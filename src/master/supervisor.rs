//! Supervision of the nodes by what they say themselves: heartbeat, NMT state,
//! boot-up, emergencies.

use crate::emcy::{Class, Emcy};
use crate::frame::Frame;
use crate::id::NodeId;
use crate::motion::{Cause, FaultCause};
use crate::network::Network;
use crate::nmt::{Consumer, ErrorControl, Heard, Lost, State};
use crate::time::{Duration, Instant};
use crate::words::in_words;
use heapless::Vec;

/// Consumer heartbeat time in percent of the producer's: the second heartbeat in
/// a row that is missing by half a period raises the alarm, the first may fall
/// to the bus.
const CONSUMER_PERCENT: u32 = 250;
const HUNDRED: u32 = 100;
const US_PER_MS: u32 = 1000;

/// Something that a node said, or no longer says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Notice {
    /// An emergency message (CiA 301, 7.2.7).
    Emcy {
        /// Who.
        node: NodeId,
        /// What.
        emcy: Emcy,
    },
    /// The heartbeat stayed away (CiA 301, 7.2.8.3.2.2).
    HeartbeatLost(Lost),
    /// The heartbeat of a node that the network does not name is back. Of the
    /// others the boot-up tells that.
    HeartbeatBack(NodeId),
    /// A boot-up message after the network was started: the node was reset, or
    /// lost its supply.
    BootUp(NodeId),
    /// Another NMT state than operational after the network was started.
    NotOperational {
        /// Who.
        node: NodeId,
        /// Its state.
        state: State,
    },
}

impl Notice {
    /// Who it is about.
    pub const fn node(&self) -> NodeId {
        match self {
            Notice::Emcy { node, .. }
            | Notice::HeartbeatBack(node)
            | Notice::BootUp(node)
            | Notice::NotOperational { node, .. }
            | Notice::HeartbeatLost(Lost { node, .. }) => *node,
        }
    }

    /// Why a running group has to stop for it, if it has.
    pub const fn fault(&self) -> Option<FaultCause> {
        match self {
            Notice::Emcy { emcy, .. } => match emcy.code.class() {
                Class::Reset | Class::Warning => None,
                Class::Fault => Some(Cause::Emergency.with(emcy.code.0 as i32)),
            },
            Notice::HeartbeatLost(_) => Some(Cause::HeartbeatLost.alone()),
            Notice::HeartbeatBack(_) => None,
            Notice::BootUp(_) | Notice::NotOperational { .. } => {
                Some(Cause::LeftOperational.alone())
            }
        }
    }

    /// What to do about it.
    pub const fn advice(&self) -> Advice {
        match self {
            Notice::Emcy { emcy, .. } => match emcy.code.class() {
                Class::Reset => Advice::None,
                Class::Warning => Advice::GoesOn,
                Class::Fault => Advice::RemoveCause,
            },
            Notice::HeartbeatLost(_) => Advice::CheckCable,
            Notice::HeartbeatBack(_) => Advice::None,
            Notice::BootUp(_) => Advice::CheckSupply,
            Notice::NotOperational { .. } => Advice::FindMaster,
        }
    }
}

in_words!(Notice {
    Notice::Emcy { node, emcy } => (
        "node {}: emergency {}, error register: {}", node, emcy.code, emcy.register
    ),
    Notice::HeartbeatLost(Lost { node, last, .. }) => (
        "node {}: heartbeat lost, last state {}", node, last
    ),
    Notice::HeartbeatBack(node) => ("node {}: heartbeat is back", node),
    Notice::BootUp(node) => ("node {}: booted again", node),
    Notice::NotOperational { node, state } => ("node {}: went to NMT {} unasked", node, state),
});

/// What to do about a [`Notice`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Advice {
    /// It is over.
    None,
    /// A warning.
    GoesOn,
    /// The drive is faulted.
    RemoveCause,
    /// The node is not heard.
    CheckCable,
    /// The node was reset.
    CheckSupply,
    /// Somebody else commands the node.
    FindMaster,
}

in_words!(Advice {
    Advice::None => ("nothing to do"),
    Advice::GoesOn => ("the drive goes on"),
    Advice::RemoveCause => ("remove the cause, then reset the node (1F82h) or the board"),
    Advice::CheckCable => ("check its cable and supply"),
    Advice::CheckSupply => ("it was reset or lost its supply: check that"),
    Advice::FindMaster => ("look for another master on the bus"),
});

/// A notice, and the axis that it is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Report {
    /// What happened.
    pub notice: Notice,
    /// Counted from 0; `None` for a node that the network does not name.
    pub axis: Option<u8>,
    /// The node has to be operational.
    armed: bool,
}

impl Report {
    /// Why the group has to stop for it. `None` if it need not, and while the
    /// node need not be operational: what a drive says then, as that it missed
    /// the master while that was reset, is overcome by its boot-up.
    pub fn fault(&self) -> Option<FaultCause> {
        self.notice.fault().filter(|_| self.armed)
    }
}

#[derive(Debug)]
struct Watched {
    consumer: Consumer,
    /// It has to be operational: whatever else it is, is a fault.
    armed: bool,
    /// That it is not operational has been reported.
    reported: bool,
}

/// Supervises up to `N` nodes.
#[derive(Debug)]
pub struct Supervisor<const N: usize> {
    nodes: Vec<Watched, N>,
    /// A node that the network does not name, and 1016h does.
    other: Option<Consumer>,
    /// As [`arm`](Supervisor::arm) was last told.
    armed: u32,
}

impl<const N: usize> Supervisor<N> {
    /// Supervises the first `N` nodes of `network`. While they boot, boot-up
    /// messages and states are what they should be; [`arm`](Self::arm) ends
    /// that.
    pub fn new(network: &Network) -> Supervisor<N> {
        let watched = network.nodes.iter().take(N).map(|node| {
            let producer_us = u32::from(node.heartbeat_ms) * US_PER_MS;
            let time = Duration::from_micros(producer_us / HUNDRED * CONSUMER_PERCENT);
            Watched {
                consumer: Consumer::new(node.id, time),
                armed: false,
                reported: false,
            }
        });
        Supervisor {
            nodes: watched.collect(),
            other: None,
            armed: 0,
        }
    }

    /// Which nodes have to stay operational from now on: bit n for the one at
    /// place n. Whoever was lost is watched again as soon as its bit is back.
    pub fn arm(&mut self, operational: u32) {
        // Every millisecond the same.
        if operational == self.armed {
            return;
        }
        self.armed = operational;
        for (place, node) in self.nodes.iter_mut().enumerate() {
            let armed = operational
                .checked_shr(place as u32)
                .is_some_and(|bits| bits & 1 != 0);
            node.reported &= node.armed || !armed;
            node.armed = armed;
        }
    }

    /// Whether the heartbeat of any node is lost.
    pub fn any_lost(&self) -> bool {
        self.nodes.iter().any(|node| node.consumer.is_lost())
    }

    /// Takes in a frame of error control or an emergency.
    pub fn on_frame(&mut self, frame: &Frame, now: Instant) -> Option<Report> {
        if let Some((node, emcy)) = Emcy::decode(frame) {
            return Some(self.report(self.axis(node), Notice::Emcy { node, emcy }));
        }
        let ErrorControl { node, state, .. } = ErrorControl::decode(frame)?;
        if let Some(other) = self.other.as_mut().filter(|other| other.node() == node) {
            let was_lost = other.is_lost();
            other.heard(state, now);
            return was_lost.then(|| self.report(None, Notice::HeartbeatBack(node)));
        }
        let axis = self.axis(node)?;
        let watched = self.nodes.get_mut(axis)?;
        let heard = watched.consumer.heard(state, now);
        if watched.reported || !watched.armed {
            return None;
        }
        let notice = match heard {
            Heard::BootUp { .. } => Notice::BootUp(node),
            _ if state != State::Operational => Notice::NotOperational { node, state },
            _ => return None,
        };
        watched.reported = true;
        Some(self.report(Some(axis), notice))
    }

    /// Looks for heartbeats that stay away: to be called every millisecond,
    /// until it returns `None`.
    pub fn poll(&mut self, now: Instant) -> Option<Report> {
        if let Some(lost) = self.other.as_mut().and_then(|other| other.poll(now)) {
            return Some(self.report(None, Notice::HeartbeatLost(lost)));
        }
        let mut nodes = self.nodes.iter_mut().enumerate();
        let (axis, lost) = nodes.find_map(|(axis, watched)| {
            let lost = watched.consumer.poll(now)?;
            // Whatever it is when it is heard again cannot be worse.
            watched.reported = true;
            Some((axis, lost))
        })?;
        Some(self.report(Some(axis), Notice::HeartbeatLost(lost)))
    }

    /// The heartbeat of `node` may stay away for `time` from now on; zero: for
    /// ever.
    pub fn set_consumer_time(&mut self, node: NodeId, time: Duration) {
        let axis = self.axis(node);
        if let Some(watched) = axis.and_then(|axis| self.nodes.get_mut(axis)) {
            watched.consumer.set_time(time);
        }
    }

    /// Watches a node that the network does not name, another NMT master for one.
    pub fn watch(&mut self, other: Option<(NodeId, Duration)>) {
        self.other = other.map(|(node, time)| Consumer::new(node, time));
    }

    #[inline(never)]
    fn axis(&self, node: NodeId) -> Option<usize> {
        let mut nodes = self.nodes.iter();
        nodes.position(|watched| watched.consumer.node() == node)
    }

    fn report(&self, axis: Option<usize>, notice: Notice) -> Report {
        let watched = axis.and_then(|axis| self.nodes.get(axis));
        Report {
            notice,
            axis: axis.map(|axis| axis as u8),
            armed: watched.is_some_and(|watched| watched.armed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::emcy::{EmcyCode, ErrorRegister};
    use crate::network::sample::SIX_EPOS4;
    use std::string::ToString;

    const NODE: NodeId = NodeId::constant::<3>();
    const ALL: u32 = 0b11_1111;
    const OTHERS: u32 = 0b11_1011;

    fn at(ms: u64) -> Instant {
        Instant::from_micros(ms * 1000)
    }

    fn heartbeat(state: State) -> Frame {
        ErrorControl::heartbeat(NODE, state).frame()
    }

    fn running() -> Supervisor<6> {
        let mut supervisor = Supervisor::new(&SIX_EPOS4);
        for (ms, state) in [
            (0, State::Initialising),
            (100, State::PreOperational),
            (200, State::Operational),
        ] {
            assert_eq!(supervisor.on_frame(&heartbeat(state), at(ms)), None);
        }
        supervisor.arm(ALL);
        supervisor
    }

    fn only(supervisor: &mut Supervisor<6>, frame: &Frame, ms: u64) -> Notice {
        let report = supervisor.on_frame(frame, at(ms)).unwrap();
        assert_eq!(report.axis, Some(2));
        report.notice
    }

    #[test]
    fn a_steady_heartbeat_is_no_news() {
        let mut supervisor = running();
        for ms in (300..3000).step_by(100) {
            let frame = heartbeat(State::Operational);
            assert_eq!(supervisor.on_frame(&frame, at(ms)), None);
            assert_eq!(supervisor.poll(at(ms + 99)), None);
        }
        assert!(!supervisor.any_lost());
    }

    #[test]
    fn a_lost_heartbeat_is_reported_once() {
        let mut supervisor = running();
        assert_eq!(supervisor.poll(at(449)), None);
        let report = supervisor.poll(at(450)).unwrap();
        assert_eq!(report.axis, Some(2));
        assert_eq!(report.notice.fault(), Some(Cause::HeartbeatLost.alone()));
        assert_eq!(supervisor.poll(at(1000)), None);
        assert!(supervisor.any_lost());
        let frame = heartbeat(State::PreOperational);
        assert_eq!(supervisor.on_frame(&frame, at(1100)), None);
        assert!(!supervisor.any_lost());
    }

    #[test]
    fn a_reset_in_operation_is_a_fault() {
        let mut supervisor = running();
        let notice = only(&mut supervisor, &heartbeat(State::Initialising), 300);
        assert_eq!(notice, Notice::BootUp(NODE));
        assert_eq!(notice.fault(), Some(Cause::LeftOperational.alone()));
        let frame = heartbeat(State::PreOperational);
        assert_eq!(supervisor.on_frame(&frame, at(400)), None);
    }

    #[test]
    fn leaving_operational_is_a_fault() {
        for state in [State::PreOperational, State::Stopped, State::Other(0x33)] {
            let mut supervisor = running();
            let notice = only(&mut supervisor, &heartbeat(state), 300);
            assert_eq!(notice, Notice::NotOperational { node: NODE, state });
            assert_eq!(notice.fault(), Some(Cause::LeftOperational.alone()));
        }
    }

    #[test]
    fn an_emergency_is_a_fault_unless_it_is_known_not_to_be() {
        for (code, fault) in [
            (0x0000, false),
            (0xFF01, false),
            (0x8611, true),
            (0xABCD, true),
        ] {
            let mut supervisor = running();
            let emcy = Emcy::new(EmcyCode(code), ErrorRegister::GENERIC);
            let notice = only(&mut supervisor, &emcy.frame(NODE), 300);
            let expected = fault.then_some(Cause::Emergency.with(code.into()));
            assert_eq!(notice.fault(), expected);
        }
    }

    #[test]
    fn an_emergency_of_a_stranger_has_no_axis() {
        let mut supervisor = running();
        let emcy = Emcy::new(EmcyCode::GENERIC, ErrorRegister::GENERIC);
        let frame = emcy.frame(NodeId::constant::<99>());
        let report = supervisor.on_frame(&frame, at(300)).unwrap();
        assert_eq!((report.axis, report.fault()), (None, None));
    }

    #[test]
    fn a_node_outside_the_network_is_watched_if_it_is_told_to() {
        const OTHER: NodeId = NodeId::constant::<9>();
        let mut supervisor = running();
        let beat = ErrorControl::heartbeat(OTHER, State::Operational).frame();
        assert_eq!(supervisor.on_frame(&beat, at(200)), None);
        assert_eq!(supervisor.poll(at(400)), None);
        supervisor.watch(Some((OTHER, Duration::from_millis(100))));
        assert_eq!(supervisor.on_frame(&beat, at(300)), None);
        assert_eq!(supervisor.poll(at(399)), None);
        let lost = supervisor.poll(at(400)).unwrap();
        assert_eq!((lost.axis, lost.fault()), (None, None));
        assert_eq!(lost.notice.node(), OTHER);
        let back = supervisor.on_frame(&beat, at(410)).unwrap();
        assert_eq!(back.notice, Notice::HeartbeatBack(OTHER));
        supervisor.watch(None);
        assert_eq!(supervisor.poll(at(440)), None);
    }

    #[test]
    fn before_the_start_nothing_is_a_fault() {
        let mut supervisor = Supervisor::<6>::new(&SIX_EPOS4);
        let emcy = Emcy::new(EmcyCode::HEARTBEAT, ErrorRegister::COMMUNICATION);
        let report = supervisor.on_frame(&emcy.frame(NODE), at(0)).unwrap();
        assert_eq!(report.fault(), None);
        supervisor.on_frame(&heartbeat(State::PreOperational), at(100));
        let report = supervisor.poll(at(400)).unwrap();
        assert!(matches!(report.notice, Notice::HeartbeatLost(_)));
        assert_eq!(report.fault(), None);
    }

    #[test]
    fn what_a_node_does_while_it_is_booted_again_is_no_fault() {
        let mut supervisor = running();
        supervisor.on_frame(&heartbeat(State::Initialising), at(300));
        supervisor.arm(OTHERS);
        for (ms, state) in [
            (310, State::Initialising),
            (400, State::PreOperational),
            (500, State::Operational),
        ] {
            assert_eq!(supervisor.on_frame(&heartbeat(state), at(ms)), None);
        }
        // Its own loss is told all the same, so that it is booted again.
        let report = supervisor.poll(at(750)).unwrap();
        assert!(matches!(report.notice, Notice::HeartbeatLost(_)));
        assert_eq!(report.fault(), None);
        // The others are watched as before.
        let other = ErrorControl::heartbeat(NodeId::constant::<5>(), State::PreOperational);
        let report = supervisor.on_frame(&other.frame(), at(760)).unwrap();
        assert_eq!(report.fault(), Some(Cause::LeftOperational.alone()));
    }

    #[test]
    fn a_node_that_is_back_is_watched_again() {
        let mut supervisor = running();
        for ms in [300, 600] {
            supervisor.arm(ALL);
            let notice = only(&mut supervisor, &heartbeat(State::PreOperational), ms);
            assert_eq!(notice.fault(), Some(Cause::LeftOperational.alone()));
            supervisor.arm(ALL);
            let frame = heartbeat(State::PreOperational);
            assert_eq!(supervisor.on_frame(&frame, at(ms + 100)), None, "told once");
            supervisor.arm(OTHERS);
            let frame = heartbeat(State::Operational);
            assert_eq!(supervisor.on_frame(&frame, at(ms + 200)), None);
        }
    }

    #[test]
    fn notices_say_what_happened_and_what_to_do() {
        let emcy = Emcy::new(EmcyCode::FOLLOWING_ERROR, ErrorRegister::MANUFACTURER);
        let notice = Notice::Emcy { node: NODE, emcy };
        assert_eq!(
            notice.to_string(),
            "node 3: emergency 8611h (following error), error register: manufacturer"
        );
        assert_eq!(
            notice.advice().to_string(),
            "remove the cause, then reset the node (1F82h) or the board"
        );
    }
}
