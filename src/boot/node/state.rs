//! The states of the boot-up of one node: one type each (CiA 302-2, "Boot
//! slave").

/// The network has not begun, or has come to its end (CiA 302-2, "NMT
/// start-up", before "Boot slave").
#[derive(Clone, Copy, Debug)]
pub(super) struct Idle;

/// Reset communication was sent: the boot-up frame is awaited, at the longest
/// for the boot time 1F89h (CiA 302-2, "Boot slave", before step 2).
#[derive(Clone, Copy, Debug)]
pub(super) struct AwaitBootUp;

/// It did not boot in its time and is looked for among the nodes without node-ID
/// (CiA 302-2, "NMT start-up": LSS is required; CiA 305).
#[derive(Clone, Copy, Debug)]
pub(super) struct Missing;

/// Reading 1000h and 1018h and comparing them with 1F84h .. 1F88h (CiA 302-2,
/// "Boot slave", steps 2 to 6; B, C, D, M, N, O).
#[derive(Clone, Copy, Debug)]
pub(super) struct Identify {
    pub(super) item: u8,
}

/// No answer to 1000h: tried again, a mandatory node until the boot time is
/// over (CiA 302-2, "Boot slave", step 2).
#[derive(Clone, Copy, Debug)]
pub(super) struct Retry;

/// A node that is to be kept alive is asked for its NMT state (CiA 302-2,
/// "Check node state", step 7; E, F).
#[derive(Clone, Copy, Debug)]
pub(super) struct AwaitState;

/// The node alone was reset on the way (CiA 302-2, "Check node state" and
/// "Restore configuration").
#[derive(Clone, Copy, Debug)]
pub(super) struct AwaitReset {
    /// Its parameters were restored; else it is yet to be verified.
    pub(super) restored: bool,
}

/// Comparing 1020h with 1F26h and 1F27h (CiA 302-2, "Check configuration",
/// step 8).
#[derive(Clone, Copy, Debug)]
pub(super) struct Verify {
    pub(super) item: u8,
}

/// Writing "load" to 1011h (CiA 302-2, "Restore configuration", step 8; J).
#[derive(Clone, Copy, Debug)]
pub(super) struct Restore;

/// Writing the configuration 1F22h (CiA 302-2, "Update configuration", step 8;
/// J).
#[derive(Clone, Copy, Debug)]
pub(super) struct Configure {
    pub(super) done: u16,
}

/// Waiting for the first heartbeat or answer to node guarding, for which the
/// boot-up frame does not count (CiA 302-2, "Start error control service",
/// step 9; K).
#[derive(Clone, Copy, Debug)]
pub(super) struct AwaitErrorControl;

/// Booted: may be started (CiA 302-2, "Boot slave", its end).
#[derive(Clone, Copy, Debug)]
pub(super) struct Ready;

/// NMT start was sent (CiA 302-2, "NMT start-up").
#[derive(Clone, Copy, Debug)]
pub(super) struct Starting;

/// It reports operational (CiA 302-2, "NMT start-up", its end; CiA 301,
/// 7.2.8.3.2).
#[derive(Clone, Copy, Debug)]
pub(super) struct Operational;

/// It was booted and is no longer what it should be (CiA 302-2, "Error
/// handler"). What follows, the network decides.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lost {
    /// It told so itself by a boot-up frame.
    pub(super) booted: bool,
}

/// Ended with a letter. An optional node that does not answer is tried for ever
/// (CiA 302-2, "Boot slave", step 2).
#[derive(Clone, Copy, Debug)]
pub(super) struct GivenUp;

#[derive(Clone, Copy, Debug)]
pub(super) enum State {
    Idle(Idle),
    AwaitBootUp(AwaitBootUp),
    Missing(Missing),
    Identify(Identify),
    Retry(Retry),
    AwaitState(AwaitState),
    AwaitReset(AwaitReset),
    Verify(Verify),
    Restore(Restore),
    Configure(Configure),
    AwaitErrorControl(AwaitErrorControl),
    Ready(Ready),
    Starting(Starting),
    Operational(Operational),
    Lost(Lost),
    GivenUp(GivenUp),
}

impl State {
    /// Whether a node without heartbeat is asked for its state.
    pub(super) const fn is_guarded(&self) -> bool {
        matches!(
            self,
            State::AwaitState(_)
                | State::AwaitErrorControl(_)
                | State::Ready(_)
                | State::Starting(_)
                | State::Operational(_)
        )
    }
}
