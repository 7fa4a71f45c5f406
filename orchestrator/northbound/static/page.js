// The station's page: its words, the live link, the frame around every view, and the view of all bays.
// This file is all the script that the first state needs; the other views are loaded when they are opened.

// --- words: [English, Korean], with {parameters}; Korean terms are those of docs/glossary.md -------------------------

export const WORDS = {
  title: ["Charging station", "충전 스테이션"],
  skip: ["Skip to the content", "본문으로 건너뛰기"],
  views: ["Views", "화면"],
  bays: ["Bays", "베이"],
  history: ["History", "기록"],
  batteries: ["Batteries", "배터리"],
  station: ["Station", "스테이션"],
  bay: ["Bay", "베이"],
  battery: ["Battery", "배터리"],
  charger: ["Charger", "충전기"],
  language: ["한국어", "English"],
  loading: ["Waiting for the station …", "스테이션의 응답을 기다립니다 …"],
  nothing: ["Nothing here yet", "아직 기록이 없습니다"],
  failed: ["This cannot be shown: {why}", "표시할 수 없습니다: {why}"],
  back: ["All bays", "모든 베이"],
  no_bay: ["This station has no bay {bay}", "이 스테이션에는 베이 {bay}이(가) 없습니다"],
  // lost
  lost: ["Not connected for {age}: values are old", "{age} 동안 연결되지 않았습니다: 이전 값입니다"],
  lost_controller: [
    "The controller has not answered for {age}: values are old",
    "제어 서비스가 {age} 동안 응답하지 않습니다: 이전 값입니다",
  ],
  old: ["old", "이전 값"],
  // people
  sign_in: ["Sign in", "로그인"],
  sign_out: ["Sign out ({name})", "로그아웃({name})"],
  name: ["Name", "이름"],
  password: ["Password", "비밀번호"],
  sign_in_first: ["Sign in to see this station.", "스테이션을 보려면 로그인하십시오."],
  sign_in_wrong: ["Name or password is wrong.", "이름 또는 비밀번호가 올바르지 않습니다."],
  only_viewer: ["Only an operator may make requests.", "작업자만 요청할 수 있습니다."],
  // states
  STARTING: ["Starting", "시작하는 중"],
  OFFLINE: ["Offline", "응답 없음"],
  IDLE: ["Idle", "유휴"],
  HELD: ["Held", "시작 대기"],
  QUALIFYING: ["Qualifying", "확인 중"],
  PRECHARGE_PULSE: ["Precharge (pulse)", "프리차지(펄스)"],
  PRECHARGE_CONTINUOUS: ["Precharge (continuous)", "프리차지(연속)"],
  CHARGING: ["Charging", "충전 중"],
  FULL: ["Full", "충전 완료"],
  SUSPENDED: ["Suspended", "일시 중단"],
  STOPPING: ["Stopping", "정지 중"],
  TRIPPED: ["Tripped", "트립"],
  UNCONTROLLABLE: ["Uncontrol\u00adlable", "제어 불능"],
  // groups of bays
  all: ["All", "전체"],
  needs: ["Needs a person", "조치 필요"],
  works: ["Charging", "충전 중"],
  rests: ["Idle or held", "유휴 또는 시작 대기"],
  waits: ["Suspended or offline", "중단 또는 응답 없음"],
  done: ["Full", "충전 완료"],
  filter: ["Show", "표시"],
  search: ["Find a bay or battery", "베이 또는 배터리 찾기"],
  none_match: ["No bay matches.", "일치하는 베이가 없습니다."],
  count_one: ["{count} bay", "베이 {count}개"],
  count: ["{count} bays", "베이 {count}개"],
  alarms: ["What needs a person", "조치가 필요한 일"],
  danger: ["Danger", "위험"],
  attention: ["Attention", "주의"],
  soc: ["State of charge", "충전 상태"],
  ready: ["ready at {at}", "{at} 완료 예정"],
  ready_between: ["ready {from} – {to}", "{from} – {to} 완료 예정"],
  // requests
  stop: ["Stop", "정지"],
  stop_bay: ["Stop {bay}", "{bay} 정지"],
  start: ["Start", "시작"],
  pause: ["Pause", "일시 정지"],
  reset: ["Reset", "리셋"],
  hold: ["Hold: {what}", "길게 누르기: {what}"],
  hold_again: ["Press again: {what}", "한 번 더 누르기: {what}"],
  start_does: [
    "Charges {bay} by the policy {policy}, once every check has passed. Hold the button for a second.",
    "모든 점검을 통과하면 정책 {policy}에 따라 {bay}을(를) 충전합니다. 버튼을 1초 동안 누르십시오.",
  ],
  reset_does: [
    "Clears the latched faults of {bay}; charging then needs a start. Hold the button for a second.",
    "{bay}의 래치된 장애를 해제합니다. 이후 충전하려면 시작해야 합니다. 버튼을 1초 동안 누르십시오.",
  ],
  pause_does: [
    "The charger stands by; a start goes on with this charge.",
    "충전기가 대기 모드가 됩니다. 시작하면 이 충전을 계속합니다.",
  ],
  stop_does: [
    "One press: the charger stands by, and only a person starts the next charge.",
    "한 번 누르면 충전기가 대기 모드가 되며, 다음 충전은 사람이 시작해야 합니다.",
  ],
  asked: ["asked", "요청함"],
  accepted: ["accepted", "수락됨"],
  seen: ["seen at the charger", "충전기에서 확인됨"],
  seen_reset: ["faults cleared", "장애 해제됨"],
  refused: ["Refused: {why}", "거부됨: {why}"],
  undelivered: [
    "Not delivered ({why}). Use the charger's own switch.",
    "전달되지 않았습니다({why}). 충전기의 스위치를 사용하십시오.",
  ],
  undone: [
    "Not delivered, not done ({why}). Press again.",
    "전달되지 않아 실행되지 않았습니다({why}). 다시 누르십시오.",
  ],
  no_answer: ["no answer within {s} s", "{s}초 안에 응답 없음"],
  because: ["Why (optional)", "이유(선택)"],
  // one bay
  now: ["Now", "현재"],
  next: ["Next", "다음"],
  faults: ["Faults", "장애"],
  since: ["since {at}", "{at}부터"],
  limits: ["Limits", "제한"],
  binds: ["binds", "현재 적용"],
  blocking: ["blocking", "차단"],
  active: ["active", "제한 중"],
  inactive: ["inactive", "제한 없음"],
  no_limits: ["Known after the first decision.", "첫 결정 후에 표시됩니다."],
  curves: ["Curves", "그래프"],
  no_curve: ["No curve is recorded yet.", "아직 기록된 그래프가 없습니다."],
  session: ["This charge", "이번 충전"],
  charged: ["Charged", "충전량"],
  energy: ["Energy", "에너지"],
  lasted: ["Lasted", "경과 시간"],
  step: ["Step", "전류 제한 단계"],
  time: ["Time", "시각"],
  voltage: ["Voltage", "전압"],
  current: ["Current", "전류"],
  temperature: ["Temperature", "온도"],
  events: ["Last events", "최근 기록"],
  policy: ["Policy", "정책"],
  label: ["Label to print", "인쇄용 라벨"],
  print: ["Print", "인쇄"],
  forecast_bmu: ["Ready, by the BMU", "완료 예정(BMU)"],
  forecast_own: ["Ready, by our estimate", "완료 예정(자체 추정)"],
  target: ["Target", "목표"],
  // history and batteries
  began: ["Began", "시작"],
  goes_on: ["goes on", "진행 중"],
  result: ["Result", "결과"],
  from_day: ["From", "시작일"],
  to_day: ["To", "종료일"],
  any: ["All", "전체"],
  apply: ["Show", "표시"],
  csv: ["CSV for a spreadsheet", "스프레드시트용 CSV"],
  more: ["Older charges", "이전 충전"],
  charge: ["Charge", "충전"],
  charges: ["Charges", "충전 횟수"],
  last_charge: ["Last charge", "마지막 충전"],
  health: ["Health", "건강 상태"],
  health_time: ["Health over time", "건강 상태 추이"],
  soh_bmu: ["SOH, by the BMU", "SOH(BMU)"],
  // station
  versions: ["Versions", "버전"],
  policies: ["Policies", "정책"],
  in_force: ["In force since", "적용 시작"],
  waiting: ["a new version waits until the bay rests", "새 버전은 베이가 쉴 때 적용됩니다"],
  used_by: ["Bays", "베이"],
  journal: ["Journal", "저널"],
  file: ["File", "파일"],
  directory: ["Directory", "디렉터리"],
  persisted: ["Persisted state", "저장된 상태"],
  well: ["no problem", "문제없음"],
  links: ["Links", "통신"],
  port: ["Port", "포트"],
  answers: ["answers", "응답함"],
  silent: ["does not answer", "응답 없음"],
  strays: ["Chargers without a bay", "베이가 없는 충전기"],
  seconds: ["{s} s", "{s}초"],
  minutes: ["{m} min", "{m}분"],
  hours: ["{h} h {m} min", "{h}시간 {m}분"],
};

const LANGUAGES = ["en", "ko"];
let language = chosenLanguage();

function chosenLanguage() {
  const kept = readKept("language");
  return LANGUAGES.includes(kept) ? kept : navigator.language.startsWith("ko") ? "ko" : "en";
}

function readKept(key) {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  } // storage may be forbidden
}

/** The word for a key in the chosen language. */
export function word(key, params = {}) {
  const text = WORDS[key]?.[LANGUAGES.indexOf(language)] ?? key;
  return text.replace(/\{(\w+)\}/g, (_, name) => params[name] ?? "");
}

// --- figures ---------------------------------------------------------------------------------------------------------

const NONE = "–",
  NARROW = "\u202f";
const locale = () =>
  language === "ko" ? "ko-KR" : navigator.language.startsWith("en-") ? navigator.language : "en-GB";
const formats = new Map(); // making one is slow

function format(kind, options) {
  const key = `${locale()} ${kind.name} ${JSON.stringify(options)}`;
  if (!formats.has(key)) formats.set(key, new kind(locale(), options));
  return formats.get(key);
}

/** The least and the most that a quantity can be, by its unit. */
const POSSIBLE = { "%": [0, 150], V: [-2000, 2000], A: [-5000, 5000], "°C": [-274, 1000], s: [-1e11, 1e11] },
  FAR = [-1e9, 1e9];

function isPossible(value, unit = "") {
  const [least, most] = POSSIBLE[unit] ?? FAR;
  return typeof value === "number" && value >= least && value <= most;
}

/** A number with this many decimals and its unit; a dash for none, or for one that cannot be. */
export function figure(value, digits, unit = "") {
  if (!isPossible(value, unit)) return NONE;
  const text = format(Intl.NumberFormat, { minimumFractionDigits: digits, maximumFractionDigits: digits }).format(
    value,
  );
  return unit ? `${text}${NARROW}${unit}` : text;
}

/** The same for a value that may be old, which it says then. */
export function shown(value, digits, unit, old) {
  const text = figure(value, digits, unit);
  return old && text !== NONE ? `${text} (${word("old")})` : text;
}

/** Whether a battery's value is old, or its BMU missing. */
export const isOld = ({ online, old = [] }, name) => online === false || old.includes(name);

/** Fills the large SOC; it is grey, and smaller with its mark, if it is old. */
export function showSoc(element, battery) {
  const old = isOld(battery, "soc_pct");
  element.classList.toggle("old", old);
  put(element, shown(battery.soc_pct, 0, "%", old));
  return element;
}

/** A moment in Unix seconds: its time of day, with the date if that is not today. */
export function moment(unixS, { seconds = false, date = false } = {}) {
  if (!isPossible(unixS, "s")) return NONE;
  const then = new Date(unixS * 1000);
  const time = { hour: "2-digit", minute: "2-digit", hourCycle: "h23", ...(seconds && { second: "2-digit" }) };
  const today = then.toDateString() === new Date().toDateString();
  const day = { year: "numeric", month: "short", day: "numeric" };
  return format(Intl.DateTimeFormat, today && !date ? time : { ...day, ...time }).format(then);
}

/** How long, in words. */
export function lasting(seconds) {
  if (!isPossible(seconds, "s")) return NONE;
  const s = Math.max(0, Math.round(seconds)),
    m = Math.floor(s / 60);
  if (s < 60) return word("seconds", { s });
  return m < 60 ? word("minutes", { m }) : word("hours", { h: Math.floor(m / 60), m: m % 60 });
}

// --- elements --------------------------------------------------------------------------------------------------------

const SVG = "http://www.w3.org/2000/svg";

/** An element. Everything that comes from outside becomes text, never markup. */
export function h(tag, given = {}, ...inside) {
  const svg = tag === "svg" || tag === "path";
  const made = svg ? document.createElementNS(SVG, tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(given)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...inside.flat(Infinity).filter((one) => one !== null && one !== undefined && one !== false));
  return made;
}

/** Sets a text only where it differs: nothing is laid out anew for the same. */
export function put(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function putAttribute(element, name, value) {
  if (value === null || value === false) element.removeAttribute(name);
  else if (element.getAttribute(name) !== String(value)) element.setAttribute(name, value);
}

/** A table: `columns` are [word, class]; `rows` are lists of texts or elements. */
export function table(caption, columns, rows) {
  const head = columns.map(([name, kind]) => h("th", { scope: "col", class: kind }, name ? word(name) : ""));
  const body = rows.map((row) =>
    h(
      "tr",
      {},
      row.map((cell, at) => h("td", { class: columns[at][1] }, cell ?? NONE)),
    ),
  );
  const made = h(
    "table",
    {},
    h("caption", { class: "unseen" }, caption),
    h("thead", {}, h("tr", {}, head)),
    h("tbody", {}, body),
  );
  return h("div", { class: "wide", tabindex: "0", role: "region", "aria-label": caption }, made);
}

/** A link to another view. */
export const link = (path, ...inside) => h("a", { href: path }, inside);
export const bayPath = (name) => `/bay/${encodeURIComponent(name)}`;

// --- states: shape beside word and colour ----------------------------------------------------------------------------

const SHAPES = {
  bolt: "M13 2 4 14h6l-1 8 10-13h-7z",
  pulse: "M2 14h5l2-8 4 14 3-9 1 3h5",
  check: "M4 13l5 5L20 6",
  ring: "M12 4a8 8 0 1 0 .01 0z",
  hand: "M7 4v16M17 4v16",
  clock: "M12 3a9 9 0 1 0 .01 0zM12 7v5l4 3",
  dots: "M4 12h1M11.5 12h1M19 12h1",
  square: "M5 5h14v14H5z",
  triangle: "M12 3 2 21h20zM12 9v6M12 17.5v.5",
  octagon: "M8 2h8l6 6v8l-6 6H8l-6-6V8zM12 7v6M12 16.5v.5",
  slash: "M12 3a9 9 0 1 0 .01 0zM6 6l12 12",
};
const STATES = {
  STARTING: ["dots", "waits"],
  OFFLINE: ["slash", "waits"],
  IDLE: ["ring", "rests"],
  HELD: ["hand", "rests"],
  QUALIFYING: ["dots", "works"],
  PRECHARGE_PULSE: ["pulse", "works"],
  PRECHARGE_CONTINUOUS: ["pulse", "works"],
  CHARGING: ["bolt", "works"],
  FULL: ["check", "done"],
  SUSPENDED: ["clock", "waits"],
  STOPPING: ["square", "waits"],
  TRIPPED: ["triangle", "rests"],
  UNCONTROLLABLE: ["octagon", "waits"],
};
const RESTING = ["IDLE", "HELD", "FULL", "SUSPENDED", "TRIPPED"],
  LEVELS = ["danger", "attention"];
export const ENERGISED = ["PRECHARGE_PULSE", "PRECHARGE_CONTINUOUS", "CHARGING"];
/** The most amperes that a charger in standby may show. */
const STANDBY_A = 0.5;

export const isUrgent = (bay) => LEVELS.includes(bay.alarm);
const groupOf = (bay) => (isUrgent(bay) ? "needs" : (STATES[bay.state]?.[1] ?? "waits"));

export function shape(name, kind = "shape") {
  return h(
    "svg",
    { viewBox: "0 0 24 24", class: `${kind} is-${name}`, "aria-hidden": "true" },
    h("path", { d: SHAPES[name] ?? SHAPES.dots }),
  );
}

/** The state as shape and word. */
export function stateMark(state) {
  return h("span", { class: "state" }, shape(STATES[state]?.[0] ?? "dots"), h("span", {}, word(state)));
}

/** Whether its own fresh reading shows that the charger stands by. */
function standsBy(bay) {
  const { charger, command } = bay;
  return (
    RESTING.includes(bay.state) &&
    bay.alarm !== "danger" &&
    command.order.action === null &&
    charger.online &&
    !charger.old &&
    charger.operation === 0 &&
    (charger.current_a ?? Infinity) <= STANDBY_A
  );
}

/** When the battery is ready: [] if unknown, one moment, or the two that the estimates give. */
function readyTimes(bay) {
  if (!ENERGISED.includes(bay.state)) return [];
  const { forecast, battery } = bay,
    minutes = battery.old?.includes("time_to_full_min") ? null : battery.time_to_full_min;
  const bmuS = typeof minutes === "number" && bay.state === "CHARGING" ? Date.now() / 1000 + 60 * minutes : null; // without a forecast, as the BMU says
  const known = forecast ? [forecast.bmu_at, forecast.own_at] : [bmuS];
  const at = known
    .filter((one) => isPossible(one, "s"))
    .sort((one, other) => one - other)
    .map((one) => moment(one));
  return at[0] === at.at(-1) ? at.slice(0, 1) : at;
}

/** The same in words. */
export function readyAt(bay) {
  const [from, to] = readyTimes(bay);
  return to ? word("ready_between", { from, to }) : from ? word("ready", { at: from }) : "";
}

// --- the live link: one stream for all tabs of a browser -------------------------------------------------------------

const QUIET_S = 12,
  STEAL_S = 8,
  REFUSED_S = 30,
  LOCK = "station stream",
  TAKEN = "503";
/** Of a clock that nobody sets, and that counts in each tab from another moment: tabs tell each other ages. */
const nowS = () => performance.now() / 1000;
const pause = (seconds) => new Promise((resolve) => setTimeout(resolve, seconds * 1000));

/** What the page knows. */
export const store = {
  revision: null,
  bays: new Map(),
  station: null,
  me: null,
  page: null,
  controller: { connected: true },
  refused: false,
};

/**
 * One tab of the browser leads: it holds a lock, has the stream, and passes every event on to the others. When it is
 * closed, the next one gets the lock. When it falls silent (a phone freezes tabs in the background), a visible tab
 * takes the lock away from it. A shared worker would do the same with one more request, and not on every phone.
 */
class Link {
  constructor(onEvent) {
    this.onEvent = onEvent;
    this.heardS = nowS(); // any sign of life
    this.connected = false;
    this.polls = false; // something between here and the station holds streams back
    this.opened = false; // the stream has begun
    this.full = false; // all its places are taken
    this.stealS = 0; // not before this
    this.leading = null; // aborts what this tab's lead is doing
    this.waiting = null; // aborts its waiting for the lock
    if (!navigator.locks || !window.BroadcastChannel) {
      this.lead();
      return;
    }
    this.channel = new BroadcastChannel("station");
    this.channel.onmessage = ({ data }) => this.hear(data);
    this.channel.postMessage({ kind: "hello" });
    this.contend();
    setInterval(() => this.watch(), 1000);
  }

  /** In every tab: how long nothing has been heard; 0 while all is well. */
  get silentS() {
    const quietS = nowS() - this.heardS;
    if (!this.connected) return Math.max(1, quietS);
    return quietS > QUIET_S ? quietS : 0;
  }

  contend(options = {}) {
    this.waiting?.abort();
    this.waiting = options.steal ? null : new AbortController();
    const wish = options.steal ? options : { signal: this.waiting.signal };
    navigator.locks
      .request(LOCK, wish, () => this.lead())
      .catch(() => {
        const stolen = this.leading !== null;
        this.leading?.abort();
        this.leading = null;
        if (stolen) this.contend(); // another tab took it: wait in line
      });
  }

  watch() {
    if (this.leading || document.hidden || nowS() - this.heardS < STEAL_S || nowS() < this.stealS) return;
    this.stealS = nowS() + STEAL_S;
    this.contend({ steal: true });
  }

  hear(message) {
    if (message.kind === "restart") {
      setLanguage(message.language, { tell: false });
      this.restart();
      return;
    }
    if (this.leading) {
      if (message.kind === "hello" && store.station) this.tellAll();
      return;
    }
    if (message.kind === "lost") this.lose(message.quietS);
    else if (message.kind !== "hello") this.live();
    if (message.kind === "event") this.onEvent(message.event, message.data, message.revision);
  }

  tell(message) {
    this.channel?.postMessage(message);
  }

  /** For a tab that has just been opened. */
  tellAll() {
    this.tell({ kind: "event", event: "link", data: store.controller, revision: null });
    this.tell({ kind: "event", event: "whole", data: wholeOf(store), revision: store.revision });
    if (!this.connected) this.tell({ kind: "lost", quietS: nowS() - this.heardS });
  }

  live() {
    this.heardS = nowS();
    this.connected = true;
  }

  lose(quietS = 0) {
    this.heardS = Math.min(this.heardS, nowS() - quietS);
    this.connected = false;
  }

  /** A sign of life from the station. */
  alive() {
    if (nowS() - this.heardS > 0.5 || !this.connected) this.tell({ kind: "alive" });
    this.live();
  }

  take(event, data, revision) {
    this.alive();
    this.onEvent(event, data, revision);
    this.tell({ kind: "event", event, data, revision });
  }

  /** Begins anew: another language, or another person. */
  restart() {
    this.stream?.abort();
    this.wake?.();
  }

  restartAll() {
    this.tell({ kind: "restart", language });
    this.restart();
  }

  async lead() {
    const lead = (this.leading = new AbortController());
    for (let failures = 0; !lead.signal.aborted;) {
      const begunS = nowS();
      const end = await this.attempt(lead.signal);
      if (lead.signal.aborted) return;
      const heard = this.heardS > begunS;
      failures = heard || end === "again" ? 0 : failures + 1;
      if (end === "more" || end === "again") continue;
      this.polls = !this.polls && (this.full || (this.opened && !heard)); // or a stream that begins, and brings nothing
      this.lose();
      this.tell({ kind: "lost", quietS: nowS() - this.heardS });
      const pauseS = store.refused ? REFUSED_S : Math.min(8, 0.5 * 2 ** failures) * (0.5 + Math.random());
      await Promise.race([
        pause(pauseS),
        new Promise((resolve) => {
          this.wake = resolve;
        }),
      ]);
    }
  }

  /** Listens for as long as that works: "more" after an answer to a poll, "again" if it is to begin anew, "lost". */
  async attempt(lead) {
    const own = (this.stream = new AbortController()),
      signal = AbortSignal.any([own.signal, lead]),
      begunS = nowS();
    const quiet = setInterval(() => {
      if (nowS() - Math.max(this.heardS, begunS) > QUIET_S) own.abort("quiet");
    }, 1000);
    this.opened = this.full = false;
    try {
      await (this.polls ? this.poll(signal) : this.listen(signal));
      return this.polls ? "more" : "lost";
    } catch (error) {
      this.full = error.message === TAKEN;
      return own.signal.aborted && own.signal.reason !== "quiet" ? "again" : "lost";
    } finally {
      clearInterval(quiet);
    }
  }

  async open(path, signal, headers = {}) {
    const answer = await fetch(path, { signal, headers, cache: "no-store" });
    const refused = answer.status === 401 || answer.status === 403;
    if (refused !== store.refused) this.take("refused", refused, null);
    if (!answer.ok) throw new Error(`${answer.status}`);
    return answer;
  }

  /** Server-sent events, read by hand: an EventSource shows neither keep-alives nor the status of a refusal. */
  async listen(signal) {
    const resumes = store.revision !== null && store.language === language;
    const answer = await this.open(
      `/api/stream?language=${language}`,
      signal,
      resumes ? { "Last-Event-ID": store.revision } : {},
    );
    store.language = language;
    this.opened = true;
    const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
    for (let rest = ""; ;) {
      const { value, done } = await reader.read();
      if (done) return;
      this.alive();
      const blocks = (rest + value).replaceAll("\r\n", "\n").split("\n\n");
      rest = blocks.pop();
      for (const block of blocks) this.event(block);
    }
  }

  event(block) {
    const fields = { event: "message", id: null, data: [] };
    for (const line of block.split("\n")) {
      const [, name, value] = /^([^:]*):? ?(.*)$/.exec(line);
      if (name === "data") fields.data.push(value);
      else if (name) fields[name] = value;
    }
    if (fields.data.length) this.take(fields.event, JSON.parse(fields.data.join("\n")), fields.id);
  }

  async poll(signal) {
    const after =
      store.revision !== null && store.language === language ? `after=${encodeURIComponent(store.revision)}&` : "";
    const answer = await this.open(`/api/status?${after}language=${language}`, signal);
    store.language = language;
    const found = await answer.json();
    this.alive();
    if (found.link) this.take("link", found.link, null);
    if (found.document) this.take("whole", found, found.revision);
    else if (found.bays) this.take("change", found, found.revision);
  }
}

function wholeOf({ revision, bays, station, me, page }) {
  return { revision, document: { ...station, bays: [...bays.values()] }, me, page };
}

function takeEvent(event, data, revision) {
  if (revision !== null && revision !== undefined) store.revision = revision;
  let names = null; // all
  if (event === "whole") {
    const { bays, ...station } = data.document;
    Object.assign(store, { bays: new Map(bays.map((bay) => [bay.name, bay])), station, me: data.me, page: data.page });
  } else if (event === "change") {
    names = Object.keys(data.bays ?? {});
    const known = names.every((name) => store.bays.has(name));
    for (const name of names) store.bays.set(name, data.bays[name]);
    for (const name of data.gone ?? []) store.bays.delete(name);
    if (!known || data.gone?.length) names = null;
    store.station = { ...store.station, ...(data.station ?? {}) };
  } else if (event === "link") store.controller = data;
  else if (event === "refused") {
    store.refused = data;
    if (data) Object.assign(store, { revision: null, bays: new Map(), station: null, me: null }); // it is not for this person's eyes
  }
  shell.update(names, event);
}

// --- requests --------------------------------------------------------------------------------------------------------

/** By bay: what was asked last and what became of it. */
const requests = new Map();
const SEEN = {
  stop: standsBy,
  pause: standsBy,
  start: (bay) => ENERGISED.includes(bay.state) && bay.charger.operation === 1,
  reset: (bay) => bay.state !== "TRIPPED" && !isUrgent(bay),
};

/** How long each may take: what is to be done at once or not at all has less. */
const ANSWER_S = { stop: 8, pause: 8, start: 5, reset: 5 };

/** Sends a request; its progress shows wherever the bay does. If the bay has changed since this moment, it is refused. */
export async function ask(action, bay, because = "", since = undefined) {
  const asked = { action, stage: "asked", text: "" };
  requests.set(bay, asked);
  shell.update([bay]);
  const given = new AbortController(),
    s = ANSWER_S[action],
    timer = setTimeout(() => given.abort(), s * 1000),
    undelivered = action === "stop" ? "undelivered" : "undone";
  try {
    const body = JSON.stringify({ action, bay, because, since });
    const answer = await fetch(`/api/request?language=${language}`, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body,
      signal: given.signal,
    });
    const said = await answer.json();
    const stage = said.ok ? "accepted" : answer.status >= 500 ? undelivered : "refused";
    Object.assign(asked, { stage, text: said.text ?? `${answer.status}` });
  } catch (error) {
    const text = given.signal.aborted ? word("no_answer", { s }) : error.message;
    Object.assign(asked, { stage: undelivered, text });
  } finally {
    clearTimeout(timer);
  }
  shell.update([bay]);
  if (asked.stage === "accepted") setTimeout(() => forget(bay, asked), 60_000);
}

function forget(bay, asked) {
  if (requests.get(bay) !== asked) return;
  requests.delete(bay);
  shell.update([bay]);
}

/** Fills an element with the progress of the bay's last request. */
export function showRequest(element, bay) {
  const asked = requests.get(bay.name);
  if (asked?.stage === "accepted" && SEEN[asked.action](bay)) {
    asked.stage = "seen";
    setTimeout(() => forget(bay.name, asked), 10_000);
  }
  const key = asked ? `${language} ${asked.action} ${asked.stage} ${asked.text}` : "";
  if (element.dataset.shown === key) return;
  element.dataset.shown = key;
  element.replaceChildren(...(asked ? progress(asked) : []));
  element.hidden = !asked;
}

function progress({ action, stage, text }) {
  const bad = ["refused", "undelivered", "undone"].includes(stage);
  if (bad) return [h("span", { class: "bad" }, shape("triangle"), `${word(action)}: `, word(stage, { why: text }))];
  const stages = ["asked", "accepted", "seen"],
    reached = stages.indexOf(stage);
  const last = action === "reset" ? "seen_reset" : "seen";
  return [
    h("span", {}, `${word(action)}: `),
    ...stages.map((one, at) =>
      h(
        "span",
        { class: at <= reached ? "reached" : "open" },
        `${at <= reached ? "●" : "○"} ${word(one === "seen" ? last : one)}`,
      ),
    ),
  ];
}

export const mayAsk = () => store.me?.role === "operator";

/** The stop button: one press. */
export function stopButton(bay, kind) {
  return h(
    "button",
    { class: `stop ${kind}`, type: "button", "aria-label": word("stop_bay", { bay }), onclick: () => ask("stop", bay) },
    shape("square", "solid"),
    h("span", {}, word("stop")),
  );
}

// --- the frame -------------------------------------------------------------------------------------------------------

const VIEWS = [
  [/^\/$/, () => baysView, "bays"],
  [/^\/bay\/(.+)$/, async () => (await import("./bay.js")).bayView, "bays"],
  [/^\/history$/, async () => (await import("./records.js")).historyView, "history"],
  [/^\/batteries$/, async () => (await import("./records.js")).batteriesView, "batteries"],
  [/^\/station$/, async () => (await import("./station.js")).stationView, "station"],
  [/^\/login$/, async () => (await import("./station.js")).loginView, "login"],
];

/** The name in a path; as it stands if it is not encoded as one. */
function decoded(name) {
  try {
    return decodeURIComponent(name);
  } catch {
    return name;
  }
}

class Shell {
  build() {
    document.documentElement.lang = language;
    this.lost = h("p", { class: "lost", role: "status", hidden: true });
    this.who = h("span", { class: "who" });
    this.name = h("span");
    const other = LANGUAGES[1 - LANGUAGES.indexOf(language)];
    const tongue = h(
      "button",
      { type: "button", class: "plain", lang: other, onclick: () => setLanguage(other) },
      word("language"),
    );
    this.tabs = ["bays", "history", "batteries", "station"].map((view) =>
      h("a", { href: view === "bays" ? "/" : `/${view}` }, word(view)),
    );
    this.main = h("main", { id: "main", tabindex: "-1" });
    document.body.replaceChildren(
      h("a", { class: "skip", href: "#main" }, word("skip")),
      h(
        "header",
        {},
        h("p", { class: "name" }, link("/", shape("bolt", "solid"), this.name)),
        h("nav", { "aria-label": word("views") }, this.tabs),
        h("div", { class: "tools" }, tongue, this.who),
      ),
      this.lost,
      this.main,
    );
  }

  async open({ focus = false } = {}) {
    const path = location.pathname,
      opening = (this.opening = Symbol(path));
    const [pattern, load, tab] = VIEWS.find(([one]) => one.test(path)) ?? VIEWS[0];
    const name = decoded(pattern.exec(path)?.[1] ?? "");
    const make = await load();
    if (this.opening !== opening) return; // another view was opened meanwhile
    this.view?.close?.();
    this.view = null;
    this.showPerson(); // before the view is made: it is not made anew, then, under a finger
    this.tab = tab;
    this.tabs.forEach((one) =>
      putAttribute(
        one,
        "aria-current",
        new URL(one.href).pathname === (tab === "bays" ? "/" : `/${tab}`) ? "page" : null,
      ),
    );
    this.main.replaceChildren();
    this.wait = store.station || tab === "login" ? null : h("p", { class: "wait" });
    if (this.wait) this.main.append(this.wait);
    else this.view = make(this.main, name);
    if (focus) {
      this.main.focus({ preventScroll: true });
      scrollTo(0, 0);
    }
    this.update(null);
  }

  /** Something is new: of these bays, or of everything. */
  update(names, event = "") {
    if (event === "whole" && this.wait) {
      this.open();
      return;
    }
    if (store.refused && this.tab !== "login") {
      this.wanted = location.pathname + location.search;
      go("/login");
      return;
    }
    if (event === "whole" && this.tab === "login") {
      go(this.wanted ?? "/");
      return;
    }
    if (this.wait) put(this.wait, word("loading"));
    put(this.name, store.station?.station ?? word("title"));
    document.title = [this.view?.title, store.station?.station ?? word("title")].filter(Boolean).join(" · ");
    this.showPerson();
    this.view?.update?.(names);
    this.tick();
  }

  showPerson() {
    const key = `${language} ${store.me?.name} ${store.me?.role} ${store.refused}`;
    const before = this.who.dataset.shown;
    if (before === key) return;
    this.who.dataset.shown = key;
    if (before && this.view) queueMicrotask(() => this.open()); // other buttons
    const local = store.me && !store.me.name;
    const out = () =>
      fetch("/api/logout", { method: "POST", headers: { "Content-Type": "application/json" }, body: "{}" }).finally(
        () => live.restartAll(),
      );
    const shown = store.me
      ? h("button", { type: "button", class: "plain", onclick: out }, word("sign_out", { name: store.me.name }))
      : link("/login", word("sign_in"));
    this.who.replaceChildren(...(local || store.refused ? [] : [shown]));
  }

  /** Each second: whether what is shown is still true. */
  tick() {
    const silentS = live?.silentS ?? 0,
      { connected, since } = store.controller;
    const text = silentS
      ? word("lost", { age: lasting(silentS) })
      : connected === false
        ? word("lost_controller", { age: lasting(typeof since === "number" ? Date.now() / 1000 - since : 0) })
        : "";
    const lost = Boolean(text) && Boolean(store.station);
    document.body.classList.toggle("stale", lost);
    this.lost.hidden = !lost;
    put(this.lost, lost ? text : "");
  }
}

/** Opens another view. */
export function go(path) {
  if (path !== location.pathname + location.search) history.pushState(null, "", path);
  shell.open({ focus: true });
}

function follow(event) {
  const target = event.target.closest("a[href]");
  if (
    !target ||
    event.defaultPrevented ||
    event.button ||
    event.metaKey ||
    event.ctrlKey ||
    event.shiftKey ||
    target.hasAttribute("download")
  )
    return;
  const url = new URL(target.href);
  if (
    url.origin !== location.origin ||
    url.hash ||
    url.pathname.startsWith("/api/") ||
    url.pathname.startsWith("/static/")
  )
    return;
  event.preventDefault();
  go(url.pathname + url.search);
}

export function setLanguage(chosen, { tell = true } = {}) {
  if (chosen === language) return;
  language = chosen;
  try {
    localStorage.setItem("language", chosen);
  } catch {
    /* it holds for this page, then */
  }
  shell.build();
  shell.open();
  if (tell) live.restartAll();
}

export const languageNow = () => language;
export const signedIn = () => live.restartAll();

// --- all bays --------------------------------------------------------------------------------------------------------

/** From so many bays on there is a filter, and from so many on the tiles are small. */
const MANY = 20,
  DENSE = 33;
/** More alarms than this have a line each. */
const MANY_ALARMS = 8;

function baysView(main) {
  const tiles = new Map();
  const filter = { group: "all", text: "" };
  const summary = h("div", { class: "summary" }),
    alarms = new Alarms();
  const chips = ["all", "needs", "works", "done", "rests", "waits"].map((group) => {
    const count = h("b");
    const chip = h(
      "button",
      {
        type: "button",
        class: "chip",
        "aria-pressed": "false",
        onclick: () => {
          filter.group = group;
          show();
        },
      },
      word(group),
      " ",
      count,
    );
    return { group, count, chip };
  });
  const search = h("input", {
    type: "search",
    placeholder: word("search"),
    "aria-label": word("search"),
    oninput: () => {
      filter.text = search.value.trim().toLowerCase();
      show();
    },
  });
  const tools = h(
    "div",
    { class: "filters", role: "group", "aria-label": word("filter") },
    chips.map(({ chip }) => chip),
    search,
  );
  const grid = h("ul", { class: "tiles" }),
    none = h("p", { class: "wait", hidden: true }, word("none_match"));
  main.append(
    h("h1", { class: "unseen" }, word("bays")),
    alarms.element,
    h("div", { class: "over" }, summary, tools),
    grid,
    none,
  );

  function matches(bay) {
    const about =
      `${bay.name} ${bay.identity?.id ?? ""} ${bay.state} ${word(bay.state)} ${bay.policy?.name ?? ""}`.toLowerCase();
    return (filter.group === "all" || groupOf(bay) === filter.group) && about.includes(filter.text);
  }

  function show() {
    const bays = [...store.bays.values()],
      counts = {};
    for (const bay of bays) counts[groupOf(bay)] = (counts[groupOf(bay)] ?? 0) + 1;
    const used = (group) => group === "all" || counts[group] || group === filter.group;
    for (const { group, count, chip } of chips) {
      put(count, figure(group === "all" ? bays.length : (counts[group] ?? 0), 0));
      putAttribute(chip, "aria-pressed", group === filter.group);
      chip.hidden = !used(group);
    }
    tools.hidden = bays.length < MANY;
    putAttribute(grid, "class", bays.length >= DENSE ? "tiles dense" : bays.length === 1 ? "tiles one" : "tiles");
    let shown = 0;
    for (const bay of bays) {
      const fits = bays.length < MANY || matches(bay);
      shown += fits;
      tiles.get(bay.name).element.hidden = !fits;
    }
    none.hidden = shown > 0;
    summarise(summary, bays);
    alarms.show(bays);
  }

  return {
    title: word("bays"),
    update(names) {
      if (!names)
        for (const name of [...tiles.keys()])
          if (!store.bays.has(name)) {
            tiles.get(name).element.remove();
            tiles.delete(name);
          }
      for (const name of names ?? store.bays.keys()) {
        if (!tiles.has(name)) tiles.set(name, new Tile(name));
        tiles.get(name).show(store.bays.get(name));
      }
      if (!names)
        grid.append(
          ...[...store.bays.keys()]
            .map((name) => tiles.get(name).element)
            .filter((one, at) => grid.children[at] !== one),
        );
      show();
    },
  };
}

/** Bays, amperes and kilowatts together; of readings that are present and not old, as `orchestrator status` does. */
function summarise(element, bays) {
  const flows = bays
    .map(({ charger }) => charger)
    .filter((one) => !one.old && isPossible(one.current_a, "A") && isPossible(one.voltage_v, "V"));
  const amps = flows.map((one) => one.current_a),
    watts = flows.map((one) => one.current_a * one.voltage_v);
  const sum = (list) => list.reduce((one, other) => one + other, 0);
  const count = word(bays.length === 1 ? "count_one" : "count", { count: figure(bays.length, 0) });
  const flow = flows.length ? [`${figure(sum(amps), 0)}${NARROW}A`, figure(sum(watts) / 1000, 1, "kW")] : [];
  put(element, [count, ...flow].join(" · "));
}

/** On top: each bay that needs a person with its reason, which begins with what to do; then the station's own problems. */
class Alarms {
  constructor() {
    this.lines = new Map(); // kept while their texts change: somebody may just be on a link
    this.list = h("ul");
    this.news = h("p", { class: "unseen", role: "alert" });
    const title = h("h2", { id: "alarms" }, word("alarms"));
    this.element = h(
      "section",
      { class: "alarms", "aria-labelledby": "alarms", hidden: true },
      title,
      this.list,
      this.news,
    );
  }

  show(bays) {
    const told = alarmsOf(bays),
      wanted = new Map(told.map((one) => [`${one.level} ${one.of}`, one]));
    for (const [key, { item }] of this.lines) {
      if (wanted.has(key)) continue;
      item.remove();
      this.lines.delete(key);
    }
    const fresh = told.filter((one) => !this.lines.has(`${one.level} ${one.of}`));
    for (const one of fresh) this.lines.set(`${one.level} ${one.of}`, this.line(one));
    for (const [key, { text }] of wanted) put(this.lines.get(key).text, ` ${text}`);
    const items = [...wanted.keys()].map((key) => this.lines.get(key).item);
    if (items.some((item, at) => this.list.children[at] !== item)) this.list.append(...items);
    putAttribute(this.list, "class", told.length > MANY_ALARMS ? "many" : null);
    this.element.hidden = !told.length;
    if (fresh.length) put(this.news, fresh.map(({ level, of }) => `${word(level)}: ${of}`).join(", "));
  }

  line({ level, of, path }) {
    const text = h("span"),
      mark = shape(level === "danger" ? "octagon" : "triangle");
    return {
      text,
      item: h("li", { class: level }, mark, h("p", {}, h("b", {}, word(level), " · ", link(path, of)), text)),
    };
  }
}

function alarmsOf(bays) {
  const urgent = bays.filter(isUrgent).sort((one, other) => LEVELS.indexOf(one.alarm) - LEVELS.indexOf(other.alarm));
  const { strays = [], journal, persisted } = store.station,
    path = "/station";
  const left = strays.filter((one) => !one.verified),
    troubled = Object.entries({ journal, persisted });
  return [
    ...urgent.map((bay) => ({ level: bay.alarm, of: bay.name, path: bayPath(bay.name), text: bay.reason })),
    ...left.map((one) => ({ level: "danger", of: one.port, path, text: one.problem || one.state })),
    ...troubled
      .filter(([, one]) => one?.problem)
      .map(([of, one]) => ({ level: "attention", of: word(of), path, text: one.problem })),
  ];
}

/** One bay among all. */
class Tile {
  constructor(name) {
    this.state = h("p", { class: "mark" });
    this.soc = h("span", { class: "soc" });
    this.level = h("span");
    this.bar = h("div", { class: "bar", "aria-hidden": "true" }, this.level);
    this.values = h("p", { class: "values" });
    this.ready = h("span", { class: "long" });
    this.at = h("span", { class: "short" });
    this.why = h("p", { class: "why" });
    this.asked = h("p", { class: "asked", role: "status", hidden: true });
    this.stop = mayAsk() ? stopButton(name, "small") : null;
    this.element = h(
      "li",
      { class: "tile" },
      h("h2", {}, link(bayPath(name), name)),
      this.state,
      h("p", { class: "charge" }, this.soc, h("span", { class: "ready" }, this.ready, this.at)),
      this.bar,
      this.values,
      this.why,
      this.asked,
      this.stop,
    );
  }

  show(bay) {
    const { battery, charger } = bay;
    putAttribute(this.element, "data-state", bay.state);
    putAttribute(this.element, "data-alarm", bay.alarm);
    if (this.state.dataset.of !== bay.state) {
      this.state.dataset.of = bay.state;
      this.state.replaceChildren(stateMark(bay.state));
    }
    const known = isPossible(battery.soc_pct, "%") && battery.online !== false;
    showSoc(this.soc, known ? battery : {});
    this.bar.classList.toggle("old", isOld(battery, "soc_pct"));
    this.level.style.width = `${known ? battery.soc_pct : 0}%`;
    const of = (name, digits, unit) => shown(known ? battery[name] : null, digits, unit, isOld(battery, name));
    put(
      this.values,
      [of("voltage_v", 2, "V"), shown(charger.current_a, 2, "A", charger.old), of("temperature_c", 1, "°C")].join(
        " · ",
      ),
    );
    put(this.ready, readyAt(bay));
    put(this.at, readyTimes(bay).at(-1) ?? "");
    put(this.why, bay.reason);
    showRequest(this.asked, bay);
  }
}

// --- begin -----------------------------------------------------------------------------------------------------------

let live = null;
const shell = new Shell();
shell.build();
live = new Link(takeEvent);
shell.open();
document.addEventListener("click", follow);
addEventListener("popstate", () => shell.open({ focus: true }));
setInterval(() => shell.tick(), 1000);
