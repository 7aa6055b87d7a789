//! How the network is started, and each node in it (CiA 302-2).

use crate::network::Network;
use crate::sdo::AbortCode;
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
    pub const OFFERED: u32 = Startup::MASTER
        | Startup::START_ALL
        | Startup::NOT_BY_ITSELF
        | Startup::NO_START
        | Startup::RESET_ALL
        | Startup::STOP_ALL;

    /// Takes over what was written to the object.
    ///
    /// # Errors
    /// 06090030h if a bit is set that is not offered.
    pub const fn new(value: u32) -> Result<Startup, AbortCode> {
        match value & !Startup::OFFERED {
            0 => Ok(Startup(value)),
            _ => Err(AbortCode::VALUE_RANGE),
        }
    }

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
    /// It may be configured and started.
    pub const MAY_START: u32 = 1 << 2;
    /// Without it the network does not start.
    pub const MANDATORY: u32 = 1 << 3;
    /// It is not reset if it is found operational.
    pub const KEEP_ALIVE: u32 = 1 << 4;
    /// Its parameters are restored before it is configured.
    pub const RESTORE: u32 = 1 << 7;
    const RETRIES: u32 = 8;
    const TIME: u32 = 16;
    /// The bits offered; bits 5 and 6, check and update of the program, are not
    /// among them.
    pub const OFFERED: u32 = Assignment::LISTED
        | Assignment::MAY_START
        | Assignment::MANDATORY
        | Assignment::KEEP_ALIVE
        | Assignment::RESTORE
        | u32::MAX << Assignment::RETRIES;

    /// Takes over what was written to the object.
    ///
    /// # Errors
    /// 06090030h if a bit is set that is not offered.
    pub const fn new(value: u32) -> Result<Assignment, AbortCode> {
        match value & !Assignment::OFFERED {
            0 => Ok(Assignment(value)),
            _ => Err(AbortCode::VALUE_RANGE),
        }
    }

    /// Whether all of these bits are set.
    pub const fn has(self, bits: u32) -> bool {
        self.0 & bits == bits
    }

    /// How often an unanswered guarding request is repeated.
    pub const fn guard_retries(self) -> u8 {
        (self.0 >> Assignment::RETRIES) as u8
    }

    /// The time between two guarding requests; zero: no guarding.
    pub const fn guard_time(self) -> Duration {
        Duration::from_millis(self.0 >> Assignment::TIME)
    }
}

/// What the boot-up of one node needs besides the network description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeSettings {
    /// 1F81h.
    pub assignment: Assignment,
    /// 1F8Ah: the sub-index of 1011h that restores the node's parameters, if
    /// [`Assignment::RESTORE`] is set; 0: none.
    pub restore: u8,
}

/// The settings of a master of at most `N` nodes; what each node has to be
/// (1F84h .. 1F88h), what is written to it (1F22h) and when that need not be done
/// (1F26h, 1F27h) is in [`Network`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings<const N: usize> {
    /// 1F80h.
    pub startup: Startup,
    /// 1F89h; zero: for ever.
    pub boot_time: Duration,
    /// In the order of the network's nodes.
    pub nodes: [NodeSettings; N],
}

impl<const N: usize> Settings<N> {
    /// As the network's design has them: all nodes are listed and may be
    /// started, by one broadcast.
    pub fn of(network: &Network) -> Settings<N> {
        let mut settings = Settings {
            startup: Startup(Startup::MASTER | Startup::START_ALL),
            boot_time: network.master.boot_time,
            nodes: [NodeSettings {
                assignment: Assignment(Assignment::LISTED | Assignment::MAY_START),
                restore: 0,
            }; N],
        };
        for (settings, node) in settings.nodes.iter_mut().zip(network.nodes) {
            if node.mandatory {
                settings.assignment.0 |= Assignment::MANDATORY;
            }
        }
        settings
    }
}
