//! The log, in words. Only `sdo_configurator`, the task of the lowest priority,
//! writes it: the others hand over what they have to say, so that no log line
//! delays them and no two collide.

use crate::counters::Counts;
use canmaster::{
    NodeId,
    boot::Event,
    master::{Notice, Report},
    motion::{FaultCause, GroupEvent, GroupState},
    network::Network,
};
use core::sync::atomic::{AtomicU32, Ordering};
use defmt::{error, info, warn};
use nucleo_g474re::{can::ErrorState, reset_cause::ResetCause};

/// Milliseconds since the start, for the log; `network` counts them.
pub(crate) static UPTIME_MS: AtomicU32 = AtomicU32::new(0);

defmt::timestamp!("{=u32:ms}", UPTIME_MS.load(Ordering::Relaxed));

/// The first fault is an error, what follows from it a warning.
macro_rules! fault {
    ($log:expr, $($words:tt)+) => {
        if core::mem::replace(&mut $log.faulted, true) {
            warn!($($words)+);
        } else {
            error!($($words)+);
        }
    };
}

/// The first line.
pub(crate) fn started(cause: ResetCause) {
    let cause = match cause {
        ResetCause::Power => defmt::intern!("power-on or brown-out"),
        ResetCause::Pin => defmt::intern!("reset pin"),
        ResetCause::Watchdog => defmt::intern!("watchdog: a task hung, or the firmware panicked"),
        ResetCause::WindowWatchdog => defmt::intern!("window watchdog"),
        ResetCause::Software => defmt::intern!("software"),
        ResetCause::LowPower => defmt::intern!("low-power mode"),
        ResetCause::OptionBytes => defmt::intern!("option bytes loaded"),
        ResetCause::Unknown => defmt::intern!("unknown"),
    };
    info!(
        "canmaster {=str}, started by: {=istr}",
        env!("CARGO_PKG_VERSION"),
        cause
    );
}

/// What `network` has to say.
#[derive(Clone, Copy)]
pub(crate) enum News {
    Node(Report),
    ErrorState(ErrorState),
    Counts(Counts),
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

    /// A step of the boot-up.
    pub(crate) fn boot(&mut self, event: &Event) {
        match event {
            Event::Failed(..) => error!("{}", event),
            Event::NetworkFailed
            | Event::IdGiven { stored: false, .. }
            | Event::IdRefused { .. }
            | Event::IdUnanswered(_)
            | Event::Stranger(_) => warn!("{}", event),
            Event::Configuring { .. } => defmt::debug!("{}", event),
            _ => info!("{}", event),
        }
    }

    /// What `network` had to say.
    pub(crate) fn news(&mut self, news: &News) {
        match news {
            News::Node(report) => self.report(report),
            News::ErrorState(ErrorState::BusOff) => fault!(
                self,
                "CAN controller bus-off: check CAN_H and CAN_L for a short or exchanged wires, the termination, and the bit rate of every node"
            ),
            News::ErrorState(ErrorState::Passive) => {
                warn!(
                    "CAN controller error passive: is any other node on the bus, and the bus terminated?"
                );
            }
            News::ErrorState(ErrorState::Warning) => {
                warn!("CAN error counter at the warning limit: check wiring and termination");
            }
            News::ErrorState(ErrorState::Active) => info!("CAN controller error active again"),
            News::Counts(counts) => warn!(
                "so far: {=u32} SYNC not sent, {=u32} RPDO sent late or not, {=u32} cycles overrun, {=u32} frames not queued, {=u32} receive overruns, {=u32} receive queue full, {=u32} TPDO too short, {=u32} log lines lost",
                counts.sync_not_sent,
                counts.rpdo_replaced,
                counts.cycle_overruns,
                counts.tx_overflows,
                counts.rx_overruns,
                counts.rx_queue_full,
                counts.tpdo_length,
                counts.log_full,
            ),
        }
    }

    fn report(&mut self, report: &Report) {
        let Report {
            axis,
            notice,
            fault,
        } = report;
        if axis.is_none() {
            warn!("{}: it is not in the network description", notice);
        } else if fault.is_some() {
            fault!(self, "{}; {}", notice, notice.advice());
        } else {
            warn!("{}", notice);
        }
    }

    /// What the group reports.
    pub(crate) fn group(&mut self, event: &GroupEvent) {
        match event {
            // The controller's state says more.
            GroupEvent::Fault {
                cause: FaultCause::NetworkLost,
                ..
            } => {
                warn!("{}", event);
            }
            GroupEvent::Fault {
                axis: Some(axis),
                cause,
            } => match self.network.nodes.get(usize::from(*axis)) {
                Some(node) => {
                    fault!(self, "node {} ({=str}): {}", node.id, node.name, cause);
                }
                None => fault!(self, "{}", event),
            },
            GroupEvent::Fault { .. } => fault!(self, "{}", event),
            GroupEvent::State {
                to: GroupState::Standby,
                ..
            } => {
                self.faulted = false;
                info!("{}: press B1 to start the motion", event);
            }
            GroupEvent::State {
                to: GroupState::Faulted,
                ..
            } => {
                warn!(
                    "{}: a lost node is booted again by itself, else reset the node (1F82h) or the board",
                    event
                );
            }
            GroupEvent::ReleaseRefused(_)
            | GroupEvent::Coasting { .. }
            | GroupEvent::NotAtRest { .. }
            | GroupEvent::Lost { .. } => warn!("{}", event),
            _ => info!("{}", event),
        }
    }
}
