"""Problems of ports and buses, devices that answer badly, and others on the line."""

from collections.abc import Mapping

TEXTS: Mapping[str, str] = {
    # a charger's serial port
    "port_not_opened": "{port}: not opened yet",
    "port_opened": "{port}: open, no answer yet",
    "port_missing": "{port}: no such port: check that the adapter is plugged in, and the name "
    "(ls -l /dev/serial/by-path)",
    "port_gone": "{port}: the adapter was unplugged or lost its power, or another program reads this port; plug it in "
    "again",
    "port_busy": "{port}: in use: another program holds it, or two bays name the same port; close the other one (lsof "
    "shows it)",
    "port_of_service": "{port}: another service (pid {pid}) has this port and commands its charger: end one of the two, "
    "or let only one station file name this port",
    "port_forbidden": "{port}: permission denied: add the user that runs this to the group dialout, then log in again",
    "port_not_serial": "{port}: it is no serial port: check the name in the station file (ls -l /dev/serial/by-path)",
    "port_stubborn": "{port}: its driver does not take the charger's settings, {baud} baud 8N1; use another adapter "
    "({found:word})",
    "port_stalled": "{port}: stalled, it took nothing for {limit_s:g} s; unplug the adapter and plug it in again",
    "port_taken": "{port}: another program has opened it for itself alone (TIOCEXCL), so that nobody else can stop this "
    "charger: end that program, or cut the charger's mains{program:after}",
    "port_too_many_files": "{port}: too many open files: raise the limit of the service (LimitNOFILE)",
    "port_not_rs485": "{port}: its driver cannot switch the direction of an RS-485 line (rs485: kernel); use an adapter "
    "that switches by itself, with rs485: off",
    "port_failed": "{port}: cannot be opened ({error:word})",
    # a charger that answers badly or not at all
    "charger_no_reply": "{port}: no answer: check the charger's power, the cable, and for swapped wires (RX and TX, or + "
    "and −)",
    "charger_noise": "{port}: only broken frames {come|came} in: check shield, ground and termination of the cable, and 19200 "
    "8N1",
    "charger_complains": "{port}: it {answers|answered} with error frames only: check shield, ground and termination of the cable",
    "charger_late": "{port}: it {answers|answered}, but not in time or not what was asked: check for a slow converter in the line",
    "charger_internal": "{port}: internal: {error}",
    "undocumented": "{value:word} {raw} (documented: {documented})",
    # others at its port
    "settings_found": "{found:word}",
    "baud": "{baud} baud",
    "line_discipline": "line discipline {number}",
    "program": "{name} (pid {pid})",
    "program_unknown": "an unknown program",
    # frames that the interlock held back
    "no_command": "{command:word} {value} is not a command for a charger in {control:word} mode",
    "no_grant": "{command:word}: no fresh reading of charger, pack voltage and pack temperature",
    "not_on_disk": "{command:word}: it is not on disk that this charger may be running",
    "grant_old": "{command:word}: the readings that it rests on are {age_s:.1f} s too old",
    "above_station_v": "{command:word}: {voltage_v:g} V is above the station's {limit_v:g} V",
    "outside_station_c": "{command:word}: {pack_c:g} °C is outside the station's {low_c:g} … {high_c:g} °C",
    "step_unknown": "{command:word}: what the charger's current limit {step:d} means is not known",
    "above_station_a": "{command:word}: step {step} is {step_a:g} A, above the station's {limit_a:g} A",
    "above_supply": "{command:word}: step {step} is above what the supply grants, {granted}",
    # a contactor's GPIO line
    "gpio_missing": "{chip} line {line}: no such GPIO chip: check the name in the station file (gpiodetect lists them)",
    "gpio_forbidden": "{chip} line {line}: permission denied: add the user that runs this to the chip's group (ls -l "
    "shows it), then log in again",
    "gpio_busy": "{chip} line {line}: in use: another program or a driver of the kernel holds the line (gpioinfo shows "
    "which)",
    "gpio_no_line": "{chip} line {line}: it has no such line, or the line cannot be an output (gpioinfo lists them)",
    "gpio_gone": "{chip} line {line}: not a GPIO chip, or one that is gone: check its name (gpiodetect lists them), or "
    "plug its adapter in again",
    "gpio_failed": "{chip} line {line}: cannot be driven ({error:word})",
    "gpio_not_installed": "the station file names a contactor, which needs the package gpiod: {install}",
    # a CAN bus
    "can_bus": "CAN bus {bus} ({wire})",
    "can_not_open": "is not open",
    "can_down": "{error:word}: the interface is down; bring it up: {command}",
    "can_no_interface": "{error:word}: there is no such interface: is the adapter plugged in? `ip link` lists what there "
    "is",
    "can_gone": "{error:word}: the adapter is gone: plug it in again",
    "can_no_device": "{error:word}: there is no such device: is the adapter plugged in? Best name it by "
    "/dev/serial/by-path",
    "can_forbidden": "{error:word}: not allowed: the service's user needs access to this device (for a serial adapter, "
    "group dialout)",
    "can_not_serial": "{error:word}: this is no serial port: check the channel in the station file",
    "can_busy": "{error:word}: another program holds it: end that program",
    "can_no_kernel": "{error:word}: this kernel has no raw CAN: modprobe can_raw, or use another interface",
    "can_queue_full": "the transmit queue is full, nobody acknowledges: check cable, terminators, bit rate, BMU's power",
    "can_failed": "{error:word}",
    "can_needs_msgpack": "udp_multicast needs msgpack: {install} ({error})",
    "can_stalled": "the adapter takes nothing any more: unplug it and plug it in again ({error})",
    "can_not_understood": "{error}: check the bus's settings in the station file, and that the interface's driver is "
    "installed",
    "can_internal": "CAN bus {bus}: internal error: {error}",
    "can_bus_off": "the controller is bus-off; check cable, terminators and bit rate. It recovers by itself only with "
    "{command}",
    "can_passive": "the controller is error-passive: check cable, terminators and bit rate",
    "can_no_ack": "nobody acknowledges our frames: check the BMU's power, cable and bit rate",
    # a BMU that does not answer or is unreliable
    "bmu_not_asked": "BMU 0x{node_id:02X} on {bus}: not asked yet",
    "bmu_stopped": "BMU 0x{node_id:02X} on {bus} {does|did} not answer: an NMT command has stopped it; NMT start wakes it",
    "bmu_cut_off": "BMU 0x{node_id:02X} on {bus} {does|did} not answer: {why}",
    "bmu_late": "BMU 0x{node_id:02X} on {bus} {does|did} not answer: its answers {come|came} later than {timeout_s:g} s "
    "(sdo_timeout_s): look for load and errors on the bus, or raise sdo_timeout_s in the station file",
    "bmu_garbled": "BMU 0x{node_id:02X} on {bus} {does|did} not answer: its newest answer {is|was} not understood: {why}",
    "bmu_unreachable": "BMU 0x{node_id:02X} on {bus} {does|did} not answer: check its power, the cable, the bit rate and its "
    "node switch (node id = switch + 0x10)",
    "bmu_doubled": "BMU 0x{node_id:02X} on {bus}: requests {are|were} answered twice: two BMUs have this node id, or something "
    "else answers for this one",
    "bmu_babbles": "BMU 0x{node_id:02X} on {bus}: it {sends|sent} more than {limit_hz} frames a second",
    "bmu_internal": "BMU 0x{node_id:02X} on {bus}: internal error: {error}",
    "sdo_length": "a frame of {size} bytes, expected {expected}: {data}",
    "sdo_command": "command 0x{command:02X}, expected 43, 4B, 4F, 60 or 80: {data}",
    "sdo_abort": "0x{index:04X}:{sub:02X} aborted with 0x{code:08X}: {meaning:word}",
    "emcy": "the BMU {reports|reported} an error of its own: EMCY 0x{code:04X}, {meaning:word} ({data})",
    # values that are not believed
    "value_outside": "{field:word} {value:g} {is|was} outside {low:g} … {high:g} (raw {raw})",
    "size_differs": "0x{index:04X}:{sub:02X} came with a size of {size}, the map says {expected}",
    "tpdo_contradicts": "{field:word}: a TPDO {says|said} {tpdo:g}, the SDO read {sdo:g}",
    "two_answers": "{field:word}: two answers to one request, {one} and {other}",
    "two_answers_elsewhere": "{field:word}: two answers to one request, which differ in {other:word}",
    "not_available": "not available",
    "a_refusal": "a refusal",
    # actions of another CANopen master
    "master_reads": "another CANopen master {reads|read} 0x{index:04X}:{sub:02X}",
    "master_writes": "another CANopen master {writes|wrote} 0x{index:04X}:{sub:02X}",
    "master_started": "another CANopen master has started {whom:word} (NMT)",
    "master_stopped": "another CANopen master has stopped {whom:word} (NMT)",
    "master_preoperational": "another CANopen master has set {whom:word} to pre-operational (NMT)",
    "master_reset": "another CANopen master has reset {whom:word} (NMT)",
    "master_reset_communication": "another CANopen master has reset the communication of {whom:word} (NMT)",
    "heartbeat_was_off": "the BMU's heartbeat was off: another master did that, or a restart that nobody heard; it is "
    "set to {period_s:g} s again",
    "heartbeat_was": "another master had set the BMU's heartbeat to {found_s:g} s; it is set to {period_s:g} s again",
}
