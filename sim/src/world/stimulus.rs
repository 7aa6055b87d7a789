//! What is done to the machine from outside, at given moments.

use std::collections::BTreeMap;

use canmaster::NodeId;

use crate::bus::BusFault;
use crate::drive::DriveFault;
use crate::time::Time;

/// One thing done to the machine.
#[derive(Clone, Debug, PartialEq)]
pub enum Stimulus {
    /// The contact of button B1 closes or opens.
    Button(bool),
    /// The reset pin is pulled low, or let go.
    Reset(bool),
    /// The supply of the board goes, or comes back.
    Power(bool),
    /// An interrupt of the board is not taken any more, until its next reset.
    Hang {
        /// Its number.
        irq: u8,
    },
    /// An interrupt that was not taken any more is taken again.
    Resume {
        /// Its number.
        irq: u8,
    },
    /// The next task that an interrupt of the board starts never ends, until the
    /// next reset: what has a lower priority waits for ever.
    Spin {
        /// Its number.
        irq: u8,
    },
    /// The next task that an interrupt of the board starts ends in a hard fault, as a
    /// panic does.
    Crash {
        /// Its number.
        irq: u8,
    },
    /// An interrupt of the board is taken late.
    DelayIrq {
        /// Its number.
        irq: u8,
        /// At most by so many core cycles, drawn anew each time.
        max_cycles: u64,
    },
    /// A drive sends nothing any more, but still hears and obeys.
    Silence {
        /// Which.
        node: NodeId,
    },
    /// A drive gets a fault; moments that have passed mean now.
    Drive {
        /// Which.
        node: NodeId,
        /// What.
        fault: DriveFault,
    },
    /// The first bus gets a fault.
    Bus(BusFault),
}

impl Stimulus {
    /// What it does to the machine, in a few words, if it does harm.
    pub(super) fn harm(&self) -> Option<String> {
        Some(match self {
            Stimulus::Button(_)
            | Stimulus::Reset(false)
            | Stimulus::Power(true)
            | Stimulus::Resume { .. }
            | Stimulus::DelayIrq { .. } => return None,
            Stimulus::Reset(true) => "board reset".into(),
            Stimulus::Power(false) => "board without supply".into(),
            Stimulus::Hang { irq } => format!("interrupt {irq} hangs"),
            Stimulus::Spin { irq } => format!("interrupt {irq} never ends"),
            Stimulus::Crash { irq } => format!("interrupt {irq} crashes"),
            Stimulus::Silence { node } => format!("node {} silent", node.get()),
            Stimulus::Drive { node, fault } => {
                format!("node {}: {}", node.get(), words(fault))
            }
            Stimulus::Bus(BusFault::Cut { .. }) => "cable cut".into(),
            Stimulus::Bus(BusFault::StuckDominant { .. }) => "short circuit".into(),
            Stimulus::Bus(BusFault::FlipBit { .. } | BusFault::BitErrors { .. }) => {
                "bit errors".into()
            }
        })
    }
}

fn words(fault: &DriveFault) -> String {
    match fault {
        DriveFault::HeartbeatLost { .. } => "heartbeat lost".into(),
        DriveFault::TpdosLost { .. } => "TPDOs lost".into(),
        DriveFault::PowerLoss { .. } | DriveFault::PowerCycle { .. } => "supply lost".into(),
        DriveFault::Load { permille, .. } => format!("load of {permille} per mille"),
        DriveFault::Blocked { .. } => "blocked".into(),
        DriveFault::Sto { .. } => "safe torque off".into(),
        DriveFault::Error { code, .. } => format!("error {code:04X}h"),
        _ => "fault".into(),
    }
}

/// What is still to be done, in the order of time and then of asking.
#[derive(Clone, Debug, Default)]
pub(super) struct Agenda {
    queue: BTreeMap<(Time, u64), Stimulus>,
    asked: u64,
}

impl Agenda {
    pub(super) fn add(&mut self, at: Time, stimulus: Stimulus) {
        self.queue.insert((at, self.asked), stimulus);
        self.asked += 1;
    }

    /// When the next one is due.
    pub(super) fn next(&self) -> Option<Time> {
        self.queue.keys().next().map(|(at, _)| *at)
    }

    /// The next one that is due by `now`.
    pub(super) fn due(&mut self, now: Time) -> Option<Stimulus> {
        if self.next()? > now {
            return None;
        }
        self.queue.pop_first().map(|(_, stimulus)| stimulus)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn harm_is_told_and_the_operator_does_none() {
        assert_eq!(Stimulus::Button(true).harm(), None);
        assert_eq!(Stimulus::Reset(true).harm().unwrap(), "board reset");
        let node = NodeId::constant::<4>();
        let (at, code, until) = (Time::ZERO, 0x2310, None);
        let fault = DriveFault::Error { at, code, until };
        let harm = Stimulus::Drive { node, fault }.harm();
        assert_eq!(harm.unwrap(), "node 4: error 2310h");
    }

    #[test]
    fn equal_moments_keep_their_order() {
        let mut agenda = Agenda::default();
        agenda.add(Time::from_ms(2), Stimulus::Reset(false));
        agenda.add(Time::from_ms(1), Stimulus::Button(true));
        agenda.add(Time::from_ms(1), Stimulus::Button(false));
        assert_eq!(agenda.next(), Some(Time::from_ms(1)));
        assert_eq!(agenda.due(Time::ZERO), None);
        assert_eq!(agenda.due(Time::from_ms(1)), Some(Stimulus::Button(true)));
        assert_eq!(agenda.due(Time::from_ms(1)), Some(Stimulus::Button(false)));
        assert_eq!(agenda.due(Time::from_ms(1)), None);
        assert_eq!(agenda.due(Time::MAX), Some(Stimulus::Reset(false)));
    }
}
