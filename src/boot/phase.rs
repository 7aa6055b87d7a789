//! The phases of the network's start (CiA 302-2, "NMT start-up").

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// Another device is the NMT master (1F80h, bit 0; CiA 302-2, "NMT
    /// start-up", its first question).
    NotMaster,
    /// Nothing is sent, so that drives left running miss the master's
    /// heartbeat and come to rest. Not of the standard: motion wants it.
    Silent,
    /// NMT reset communication is sent; the nodes boot, each at its own pace
    /// (CiA 302-2, "NMT start-up", "Reset communication" and "Boot slave").
    Booting,
    /// The start is left to the application (1F80h, bit 2; CiA 302-2, "NMT
    /// start-up", "Enter operational by itself").
    AwaitingOrder,
    /// SYNC runs; after a few of them the nodes are started (CiA 301, 7.2.5).
    /// Not of the standard: drives want to see the period first.
    Synchronising,
    /// NMT start is sent; every node has to report operational (CiA 302-2, "NMT
    /// start-up", "Start slaves"; 1F80h, bits 1 and 3).
    Starting,
    /// The network runs, or would if no node were missing (CiA 302-2, "NMT
    /// start-up", its end; "Error handler" for what follows).
    Running,
    /// All nodes were stopped after the error of a mandatory one (1F80h, bit 6;
    /// CiA 302-2, "Error handler").
    Stopped,
    /// A mandatory node failed: the start is halted (CiA 302-2, "NMT start-up",
    /// "Halt").
    Failed,
    /// The controller is bus-off (ISO 11898-1, fault confinement).
    BusOff,
}

impl Phase {
    /// Whether time alone leads out.
    pub(super) const fn is_timed(self) -> bool {
        matches!(self, Phase::Silent | Phase::Synchronising | Phase::BusOff)
    }

    /// Whether the nodes' frames are of interest.
    pub(super) const fn listens(self) -> bool {
        matches!(
            self,
            Phase::Booting
                | Phase::AwaitingOrder
                | Phase::Synchronising
                | Phase::Starting
                | Phase::Running
        )
    }
}
