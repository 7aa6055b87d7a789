//! The phases of the network's start (CiA 302-2, "NMT start-up").

use crate::time::Instant;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// Another device is the NMT master (1F80h, bit 0).
    NotMaster,
    /// Nothing is sent, so that drives left running miss the master's
    /// heartbeat and come to rest.
    Silent { until: Instant },
    /// Nodes without node-ID are looked for (CiA 305).
    Scanning,
    /// NMT reset communication is sent; the nodes boot, each at its own pace.
    Booting,
    /// The start is left to the application (1F80h, bit 2).
    AwaitingOrder,
    /// SYNC runs; after a few of them the nodes are started.
    Synchronising { until: Instant },
    /// NMT start is sent; every node has to report operational.
    Starting,
    /// The network runs, or would if no node were missing.
    Running,
    /// All nodes were stopped after the error of a mandatory one (1F80h, bit 6).
    Stopped,
    /// A mandatory node failed: the start is halted.
    Failed,
    /// The controller is bus-off until this moment.
    BusOff { until: Instant },
}

impl Phase {
    /// When time alone leads out.
    pub(super) const fn deadline(self) -> Option<Instant> {
        match self {
            Phase::Silent { until } | Phase::Synchronising { until } | Phase::BusOff { until } => {
                Some(until)
            }
            _ => None,
        }
    }

    /// Whether the nodes' frames are of interest.
    pub(super) const fn listens(self) -> bool {
        matches!(
            self,
            Phase::Scanning
                | Phase::Booting
                | Phase::AwaitingOrder
                | Phase::Synchronising { .. }
                | Phase::Starting
                | Phase::Running
        )
    }
}
