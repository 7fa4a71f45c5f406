// The QR code of a label, by qrcode-generator (vendor/).

import qrcode from "./vendor/qrcode-generator-2.0.4.js";

/** The code as one SVG path, with the quiet zone that readers need, and its size. */
export function qrPath(text) {
  const code = qrcode(0, "M");
  code.addData(text);
  code.make();
  const count = code.getModuleCount(),
    quiet = 4,
    cells = [];
  for (let y = 0; y < count; y++)
    for (let x = 0; x < count; x++) if (code.isDark(y, x)) cells.push(`M${x + quiet} ${y + quiet}h1v1h-1z`);
  return { path: cells.join(""), size: count + 2 * quiet };
}
