//! The firmware's constants, each with its reason. What belongs to the network
//! rather than to the firmware is in [`crate::network`].

use crate::sync::SyncLimits;
use crate::time::Duration;

/// What the board is called (1008h).
pub const DEVICE_NAME: &str = "canmaster";
/// On what hardware it is (1009h).
pub const HARDWARE_VERSION: &str = "NUCLEO-G474RE";

/// Axes of the group.
pub const AXES: usize = 6;

/// When the PDO producer goes ahead without the TPDOs that are missing, in
/// microseconds after the SYNC. Twelve TPDOs take 1.4 ms on the wire at worst
/// and drives start sending within a millisecond; what is not here after half a
/// cycle will not come, and the other half is enough for the RPDOs (1.5 ms at
/// worst) with plenty left for everything else.
pub const TPDO_DEADLINE_US: u16 = 5_000;

/// Cycles in a row without a TPDO after which its drive counts as lost: one may
/// fall to a bus error and one to its retransmission.
pub const TPDO_MISSING_LIMIT: u8 = 3;

/// The watchdog's time in milliseconds. Ten cycles: far longer than anything a
/// healthy firmware does, and short against the time in which the drives miss
/// the master's heartbeat, so that a hung master is silent soon.
pub const WATCHDOG_MS: u32 = 100;

/// Samples of a millisecond that the button's contact has to keep still.
/// Contacts of this kind bounce for up to 5 ms.
pub const BUTTON_SAMPLES: u8 = 20;

/// Frames that may wait for a transmit buffer. At worst the twelve RPDOs of a
/// cycle in which all ramps change, an SDO request or an abort for each of six
/// nodes, an NMT command for each, and a heartbeat: 25, besides [`OWN_FRAMES`].
pub const TX_QUEUE: usize = 36;

/// While so many frames wait for a transmit buffer, the board's own SDO server
/// and the transfer test send no further segment of a block: the rest of the
/// queue is for those who cannot wait. Ten of 111 bits and more keep the bus busy
/// at 1 Mbit/s for longer than the millisecond after which the next are made.
pub const OWN_FRAMES: usize = 10;

/// From the first RPDO of a cycle handed over to the last one sent, in
/// microseconds: six of six bytes and six of eight take 1.5 ms on the wire at
/// worst, after a frame that is on it.
pub const RPDOS_US: u16 = 2_000;

/// What the firmware can do of 1006h and 1007h. The shortest period is the
/// deadline of the TPDOs and as much again for the RPDOs; the longest is what the
/// 16 bits of the deadline's timer count. The window has to hold deadline, steps
/// of the axes, and RPDOs.
pub const SYNC_LIMITS: SyncLimits = SyncLimits {
    shortest_period: 2 * TPDO_DEADLINE_US as u32,
    longest_period: u16::MAX as u32,
    shortest_window: (TPDO_DEADLINE_US + RPDOS_US) as u32 + 500,
};

/// Changed settings that may wait for `network`, which takes them every
/// millisecond: a write of 1016h makes one for each node, one for a node outside
/// the network, and a client has no time for more than four writes (of two frames
/// of at least 111 bits each at 1 Mbit/s). The rest is the ring's empty place.
pub const ORDER_QUEUE: usize = 4 * (AXES + 2);

/// Frames that may wait for a task, plus one that the ring leaves empty. The
/// tasks are woken by the first; this is a burst from every node at once.
pub const RX_QUEUE: usize = 32;

/// Reports that may wait for the log.
pub const LOG_QUEUE: usize = 32;

/// How often the LEDs are switched, in milliseconds: far below their shortest
/// phase of 50 ms.
pub const LED_MS: u32 = 10;

/// How often the counters of what must not happen are looked at, in
/// milliseconds: a fault that comes every cycle fills the log slowly.
pub const COUNTS_MS: u32 = 1000;

/// After how long the configurator runs at the latest, so that it shows up in
/// the watchdog's roll call several times in its period.
pub const CONFIGURATOR_PERIOD: Duration = Duration::from_millis(20);
