//! The log, in words. Only `sdo_configurator`, the task of the lowest priority,
//! writes it: the others hand over what they have to say, so that no log line
//! delays them and no two collide.

use crate::{counters::Count, measured};
use canmaster::{
    NodeId,
    boot::Event,
    master::{Notice, Report, WrongLength},
    motion::{Cause, FaultCause, GroupEvent, GroupState},
    network::{Network, Node},
};
use canmaster_words::in_log;
use core::sync::atomic::{AtomicU32, Ordering};
use nucleo_g474re::{can::ErrorState, reset_cause::ResetCause};

/// Milliseconds since the start, for the log; `network` counts them.
pub(crate) static UPTIME_MS: AtomicU32 = AtomicU32::new(0);

defmt::timestamp!("{=u32:ms}", UPTIME_MS.load(Ordering::Relaxed));

/// How much a line matters.
#[derive(Clone, Copy)]
enum Level {
    Debug,
    Info,
    Warning,
    Error,
}

/// A line of the log. Each kind is formatted in one place for all levels.
#[derive(Clone, Copy)]
enum Line<'a> {
    Started(ResetCause),
    Silent(u32),
    NotStored,
    Controller(ErrorState),
    Counts,
    Measured,
    Boot(&'a Event),
    Notice(&'a Notice),
    /// Of a node that the network does not name.
    Foreign(&'a Notice),
    /// With what to do about it.
    Advised(&'a Notice),
    Group(&'a GroupEvent),
    Standby(&'a GroupEvent),
    Faulted(&'a GroupEvent),
    AxisFault(&'a Node, &'a FaultCause),
}

in_log!(Line<'_> {
    Line::Started(cause) => (
        "canmaster {}, started by: {}", env!("CARGO_PKG_VERSION"), Start(cause)
    ),
    Line::Silent(ms) => ("silent for {} ms, so that drives left running come to rest", ms),
    Line::NotStored => (
        "settings are not stored (1010h): set option bit DBANK, then flash again"
    ),
    Line::Controller(state) => ("{}", Controller(state)),
    Line::Counts => (
        "so far: {} SYNC not sent, {} RPDO sent late or not, {} cycles overrun, {} frames not queued, {} receive overruns, {} receive queue full, {} TPDO too short, {} log lines lost",
        Count::SyncNotSent.get(),
        Count::RpdoReplaced.get(),
        Count::CycleOverruns.get(),
        Count::TxOverflows.get(),
        Count::RxOverruns.get(),
        Count::RxQueueFull.get(),
        Count::TpdoLength.get(),
        Count::LogFull.get()
    ),
    Line::Measured => (
        "SYNC jitter {} us, cycle {} us, pdo_producer {} cycles, bus {} per mille, CPU {} per mille, {} overruns",
        measured::entry(1),
        measured::entry(3),
        measured::entry(6),
        measured::entry(8),
        measured::entry(9),
        measured::entry(10)
    ),
    Line::Boot(event) => ("{}", *event),
    Line::Notice(notice) => ("{}", *notice),
    Line::Foreign(notice) => ("{}: it is not in the network description", *notice),
    Line::Advised(notice) => ("{}; {}", *notice, notice.advice()),
    Line::Group(event) => ("{}", *event),
    Line::Standby(event) => ("{}: press B1 to start the motion", *event),
    Line::Faulted(event) => (
        "{}: a lost node is booted again by itself, else reset the node (1F82h) or the board",
        *event
    ),
    Line::AxisFault(node, cause) => ("node {} ({}): {}", node.id, node.name, *cause),
});

/// Why the board started.
#[derive(Clone, Copy)]
struct Start(ResetCause);

in_log!(Start {
    Start(ResetCause::Power) => ("power-on or brown-out"),
    Start(ResetCause::Pin) => ("reset pin"),
    Start(ResetCause::Watchdog) => ("watchdog: a task hung, or the firmware panicked"),
    Start(ResetCause::WindowWatchdog) => ("window watchdog"),
    Start(ResetCause::Software) => ("software"),
    Start(ResetCause::LowPower) => ("low-power mode"),
    Start(ResetCause::OptionBytes) => ("option bytes loaded"),
    Start(ResetCause::Unknown) => ("unknown"),
});

/// What the state of the CAN controller means.
#[derive(Clone, Copy)]
struct Controller(ErrorState);

in_log!(Controller {
    Controller(ErrorState::Active) => ("CAN controller error active again"),
    Controller(ErrorState::Warning) => (
        "CAN error counter at the warning limit: check wiring and termination"
    ),
    Controller(ErrorState::Passive) => (
        "CAN controller error passive: is any other node on the bus, and the bus terminated?"
    ),
    Controller(ErrorState::BusOff) => (
        "CAN controller bus-off: check CAN_H and CAN_L for a short or exchanged wires, the termination, and the bit rate of every node"
    ),
});

#[inline(never)]
fn write(level: Level, line: Line<'_>) {
    match level {
        Level::Debug => defmt::debug!("{}", line),
        Level::Info => defmt::info!("{}", line),
        Level::Warning => defmt::warn!("{}", line),
        Level::Error => defmt::error!("{}", line),
    }
}

/// The first lines: why the board started, how long it is silent, and whether its
/// settings are kept.
pub(crate) fn started(cause: ResetCause, silence_ms: u32, stored: bool) {
    write(Level::Info, Line::Started(cause));
    write(Level::Info, Line::Silent(silence_ms));
    if !stored {
        write(Level::Warning, Line::NotStored);
    }
}

/// What `network` has to say.
#[derive(Clone, Copy)]
pub(crate) enum News {
    Node(Report),
    ErrorState(ErrorState),
    /// The counts have changed.
    Counts,
    /// The last TPDO of wrong length since the one before.
    WrongLength(WrongLength),
    /// A second is over.
    Measured,
}

impl News {
    /// A node of the network whose heartbeat stays away.
    pub(crate) const fn lost_node(&self) -> Option<NodeId> {
        match self {
            News::Node(Report {
                axis: Some(_),
                notice: Notice::HeartbeatLost(lost),
                ..
            }) => Some(lost.node),
            _ => None,
        }
    }

    /// A node that has missed the bus or the master while it was being booted. A
    /// drive leaves that error by a reset of its communication alone.
    pub(crate) fn cut_off_node(&self) -> Option<NodeId> {
        let News::Node(report) = self else {
            return None;
        };
        match report.notice {
            Notice::Emcy { node, emcy } if emcy.code.is_cut_off() => {
                report.fault().is_none().then_some(node)
            }
            _ => None,
        }
    }
}

/// Writes the log.
pub(crate) struct Log {
    network: &'static Network,
    /// The first fault is the error; what follows from it is a warning, so that
    /// the last error line is the reason.
    faulted: bool,
}

impl Log {
    pub(crate) const fn new(network: &'static Network) -> Log {
        Log {
            network,
            faulted: false,
        }
    }

    /// The first fault is an error, what follows from it a warning.
    fn fault(&mut self) -> Level {
        match core::mem::replace(&mut self.faulted, true) {
            true => Level::Warning,
            false => Level::Error,
        }
    }

    /// A step of the boot-up.
    #[inline(never)]
    pub(crate) fn boot(&mut self, event: &Event) {
        let level = match event {
            Event::Failed(..) => Level::Error,
            Event::NetworkFailed
            | Event::IdGiven { stored: false, .. }
            | Event::IdRefused { .. }
            | Event::IdUnanswered(_)
            | Event::Stranger(_) => Level::Warning,
            Event::Configuring { .. } => Level::Debug,
            _ => Level::Info,
        };
        write(level, Line::Boot(event));
    }

    /// What `network` had to say.
    #[inline(never)]
    pub(crate) fn news(&mut self, news: &News) {
        let (level, line) = match news {
            News::Node(report) => return self.report(report),
            News::Counts => (Level::Warning, Line::Counts),
            // It is counted, too.
            News::WrongLength(_) => return,
            News::Measured => (Level::Debug, Line::Measured),
            News::ErrorState(state) => {
                let level = match state {
                    ErrorState::BusOff => self.fault(),
                    ErrorState::Passive | ErrorState::Warning => Level::Warning,
                    ErrorState::Active => Level::Info,
                };
                (level, Line::Controller(*state))
            }
        };
        write(level, line);
    }

    fn report(&mut self, report: &Report) {
        let notice = &report.notice;
        let (level, line) = if report.axis.is_none() {
            (Level::Warning, Line::Foreign(notice))
        } else if report.fault().is_some() {
            (self.fault(), Line::Advised(notice))
        } else {
            (Level::Warning, Line::Notice(notice))
        };
        write(level, line);
    }

    /// What the group reports.
    #[inline(never)]
    pub(crate) fn group(&mut self, event: &GroupEvent) {
        let (level, line) = match event {
            // The controller's state says more.
            GroupEvent::Fault {
                cause:
                    FaultCause {
                        cause: Cause::NetworkLost,
                        ..
                    },
                ..
            } => (Level::Warning, Line::Group(event)),
            GroupEvent::Fault { axis, cause } => {
                let axis = axis.map(usize::from);
                let node = axis.and_then(|axis| self.network.nodes.get(axis));
                let line = node.map_or(Line::Group(event), |node| Line::AxisFault(node, cause));
                (self.fault(), line)
            }
            GroupEvent::State {
                to: GroupState::Standby,
                ..
            } => {
                self.faulted = false;
                (Level::Info, Line::Standby(event))
            }
            GroupEvent::State {
                to: GroupState::Faulted,
                ..
            } => (Level::Warning, Line::Faulted(event)),
            GroupEvent::ReleaseRefused(_)
            | GroupEvent::ProgramFailed(_)
            | GroupEvent::MoveRefused(_)
            | GroupEvent::Coasting { .. }
            | GroupEvent::NotAtRest { .. }
            | GroupEvent::Lost { .. } => (Level::Warning, Line::Group(event)),
            _ => (Level::Info, Line::Group(event)),
        };
        write(level, line);
    }
}
