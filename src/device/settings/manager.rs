//! How the network is started, and each node in it (CiA 302-2).

use crate::time::Duration;

/// NMT start-up, object 1F80h (CiA 302-2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Startup(pub u32);

impl Startup {
    /// This device is the NMT master.
    pub const MASTER: u32 = 1 << 0;
    /// NMT start goes to all nodes at once; else to one by one.
    pub const START_ALL: u32 = 1 << 1;
    /// The master does not enter operational by itself.
    pub const NOT_BY_ITSELF: u32 = 1 << 2;
    /// The master does not start nodes.
    pub const NO_START: u32 = 1 << 3;
    /// An error of a mandatory node resets all nodes.
    pub const RESET_ALL: u32 = 1 << 4;
    /// An error of a mandatory node stops all nodes; goes before
    /// [`RESET_ALL`](Self::RESET_ALL).
    pub const STOP_ALL: u32 = 1 << 6;
    /// The bits offered; bit 5, flying master, is not one of them.
    pub(super) const OFFERED: u32 = Startup::MASTER
        | Startup::START_ALL
        | Startup::NOT_BY_ITSELF
        | Startup::NO_START
        | Startup::RESET_ALL
        | Startup::STOP_ALL;

    /// Whether all of these bits are set.
    pub const fn has(self, bits: u32) -> bool {
        self.0 & bits == bits
    }
}

/// NMT slave assignment, object 1F81h (CiA 302-2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Assignment(pub u32);

impl Assignment {
    /// The node is in the list of this master.
    pub const LISTED: u32 = 1 << 0;
    /// It may be started.
    pub const MAY_START: u32 = 1 << 2;
    /// Without it the network does not start.
    pub const MANDATORY: u32 = 1 << 3;
    /// It is not reset if it is found operational.
    pub const KEEP_ALIVE: u32 = 1 << 4;
    /// Its parameters are restored before it is configured.
    pub const RESTORE: u32 = 1 << 7;
    /// Bits 15..8 and 31..16.
    const GUARDING: u32 = 0xFFFF_FF00;
    /// The bits offered; bits 5 and 6, check and update of the program, are not
    /// among them.
    pub(super) const OFFERED: u32 = Assignment::LISTED
        | Assignment::MAY_START
        | Assignment::MANDATORY
        | Assignment::KEEP_ALIVE
        | Assignment::RESTORE
        | Assignment::GUARDING;

    /// Whether all of these bits are set.
    pub const fn has(self, bits: u32) -> bool {
        self.0 & bits == bits
    }

    /// How often an unanswered guarding request is repeated.
    pub const fn guard_retries(self) -> u8 {
        (self.0 >> 8) as u8
    }

    /// The time between two guarding requests; zero: no guarding.
    pub const fn guard_time(self) -> Duration {
        Duration::from_millis(self.0 >> 16)
    }
}
