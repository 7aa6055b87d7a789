//! The firmware's constants, each with its reason. What belongs to the network
//! rather than to the firmware is in [`crate::network`].

use crate::time::Duration;

/// What the board is called (1008h).
pub const DEVICE_NAME: &str = "canmaster";
/// On what hardware it is (1009h).
pub const HARDWARE_VERSION: &str = "NUCLEO-G474RE";

/// The watchdog's time in milliseconds: longer than the longest cycle that the
/// timers count, far longer than anything a healthy firmware does, and short
/// against the time in which the drives miss the master's heartbeat, so that a
/// hung master is silent soon.
pub const WATCHDOG_MS: u32 = 100;

/// Cycles in a row that may be late, not taken up before the next SYNC or with RPDOs
/// that did not get out: the next one stops the group. One is no harm, the drives go
/// on with the commands that they have; after three, as with missing TPDOs, nobody
/// leads them any more.
pub const LATE_CYCLES_MAX: u8 = 2;

/// Samples of a millisecond that the button's contact has to keep still.
/// Contacts of this kind bounce for up to 5 ms.
pub const BUTTON_SAMPLES: u8 = 20;

/// Frames besides the RPDOs of every cycle that may wait for a transmit buffer. At
/// worst the ramps of each axis, an SDO request or an abort for each node, an NMT
/// command for each, and a heartbeat, besides [`OWN_FRAMES`].
pub const fn tx_queue(axes: usize) -> usize {
    3 * axes + OWN_FRAMES + 2
}

/// While so many frames wait for a transmit buffer, the board's own SDO server
/// and the transfer test send no further segment of a block: the rest of the
/// queue is for those who cannot wait. Ten of 111 bits and more keep the bus busy
/// at 1 Mbit/s for longer than the millisecond after which the next are made.
pub const OWN_FRAMES: usize = 10;

/// Segments that a client may send to the board's SDO server one behind the other in a
/// block download. More of them fill the bus as long as the block lasts, and no layout of
/// the cycle has room for that: RPDOs came too late, and the group stopped.
pub const OWN_BLOCK: u8 = 1;

/// Frames that may wait for a task, plus one that the ring leaves empty. The
/// tasks are woken by the first; this is a burst from every node at once.
pub const fn rx_queue(axes: usize) -> usize {
    4 * (axes + 2)
}

/// The same of frames of which each node sends one at most before it is answered, and
/// one that nobody waits for any more: answers to the boot-up, and states.
pub const fn answer_queue(axes: usize) -> usize {
    2 * (axes + 2)
}

/// Reports that may wait for the log.
pub const fn log_queue(axes: usize) -> usize {
    4 * (axes + 2)
}

/// How often overdue heartbeats and guarding answers are looked for, in
/// milliseconds: far below any time that is waited for one.
pub const SUPERVISION_MS: u32 = 4;

/// How often the LEDs are switched, in milliseconds: far below their shortest
/// phase of 50 ms.
pub const LED_MS: u32 = 10;

/// How often the counters of what must not happen are looked at, in
/// milliseconds: a fault that comes every cycle fills the log slowly.
pub const COUNTS_MS: u32 = 1000;

/// After how long the configurator runs at the latest, so that it shows up in
/// the watchdog's roll call twice in its period.
pub const CONFIGURATOR_PERIOD: Duration = Duration::from_millis(40);
