//! What can be seen of the machine and done to it from outside.

use canmaster::NodeId;

use super::stimulus::Stimulus;
use super::{FIRST, Machine, World, watch};
use crate::board::Board;
use crate::bus::{PortId, WireRecord};
use crate::drive::{Drive, DriveFault, DriveStatus, PlantState};
use crate::log::LogLine;
use crate::time::Time;

impl World<'_> {
    /// Does something to the machine now.
    pub fn apply(&mut self, stimulus: Stimulus) {
        if let Some(words) = stimulus.harm() {
            self.marks.push((self.now, words));
        }
        match stimulus {
            Stimulus::Button(pressed) => self.board.set_button(pressed),
            Stimulus::Reset(true) => {
                self.watch.revoke(self.now + watch::LAST_COMMAND);
                self.decoder.restart();
                self.board.hold_in_reset();
            }
            Stimulus::Power(false) => {
                self.watch.revoke(self.now + watch::LAST_COMMAND);
                self.decoder.restart();
                self.board.power_off();
            }
            Stimulus::Reset(false) | Stimulus::Power(true) => self.board.release_reset(),
            Stimulus::Hang { irq } => self.board.hang_irq(irq),
            Stimulus::Resume { irq } => self.board.resume_irq(irq),
            Stimulus::Spin { irq } => self.board.spin_irq(irq),
            Stimulus::Crash { irq } => self.board.crash_irq(irq),
            Stimulus::DelayIrq { irq, max_cycles } => {
                self.board.delay_irq(irq, max_cycles, self.scenario.seed);
            }
            Stimulus::Silence { node } => {
                let at = self.now;
                self.fault(node, DriveFault::HeartbeatLost { at });
                self.fault(node, DriveFault::TpdosLost { at });
                self.fault(node, DriveFault::SdoDead { at });
            }
            Stimulus::Drive { node, fault } => self.fault(node, fault),
            Stimulus::Bus(fault) => self.lines[FIRST].bus.inject(fault),
        }
    }

    /// Does something to the machine later.
    pub fn schedule(&mut self, at: Time, stimulus: Stimulus) {
        self.agenda.add(at, stimulus);
    }

    /// Presses the button with bouncing contacts and lets it go again. In
    /// standby that is a release, in motion a stop.
    pub fn press(&mut self) {
        if self.watch.ready() {
            self.watch.release(self.now);
        } else {
            self.watch.revoke(self.now + watch::LAST_COMMAND);
        }
        let mut presses = Vec::new();
        self.operator.press(self.now, &mut presses);
        for (at, stimulus) in presses {
            self.agenda.add(at, stimulus);
        }
    }

    fn fault(&mut self, node: NodeId, fault: DriveFault) {
        let station = self
            .machine
            .network()
            .find(node)
            .and_then(|(axis, _)| self.stations[axis].as_mut());
        if let Some(station) = station {
            station.drive.inject(fault);
        }
    }

    /// The machine that the firmware is built for.
    pub fn machine(&self) -> &Machine {
        self.machine
    }

    /// The present moment.
    pub fn now(&self) -> Time {
        self.now
    }

    /// When the scenario ends.
    pub fn end(&self) -> Time {
        self.scenario.end
    }

    /// All drives are enabled and at rest: a press of the button releases
    /// motion.
    pub fn ready(&self) -> bool {
        self.watch.ready()
    }

    /// No axis moves.
    pub fn at_rest(&self) -> bool {
        self.watch.at_rest()
    }

    /// All axes turn.
    pub fn in_full_motion(&self) -> bool {
        self.truths()
            .flatten()
            .all(|truth| watch::is_full_motion(truth.velocity_rpm))
    }

    /// What is true of each axis; `None`: not on the bus.
    pub fn truths(&self) -> impl Iterator<Item = Option<PlantState>> + '_ {
        self.stations
            .iter()
            .map(|station| station.as_ref().map(|station| station.drive.truth()))
    }

    /// What each drive is in; `None`: not on the bus.
    pub fn statuses(&self) -> impl Iterator<Item = Option<DriveStatus>> + '_ {
        self.stations
            .iter()
            .map(|station| station.as_ref().map(|station| station.drive.status()))
    }

    /// What the drive is in that the network does not name, if there is one.
    pub fn stranger(&self) -> Option<DriveStatus> {
        self.strangers.first().map(|station| station.drive.status())
    }

    /// Round trips that were finished, and whether one is going on.
    pub fn round_trips(&self) -> (usize, bool) {
        let done = self
            .watch
            .releases
            .iter()
            .filter(|release| release.done.is_some())
            .count();
        let going_on = self
            .watch
            .releases
            .last()
            .is_some_and(|release| release.done.is_none() && !release.revoked);
        (done, going_on)
    }

    /// What was on the wire of the first bus so far.
    pub fn wire(&self) -> &[WireRecord] {
        self.wire_of(FIRST)
    }

    /// What was on the wire of a bus so far, by its place in the machine; nothing
    /// if there is no such bus.
    pub fn wire_of(&self, bus: usize) -> &[WireRecord] {
        self.lines.get(bus).map_or(&[], |line| &line.wire)
    }

    /// The firmware's log so far.
    pub fn log(&self) -> &[(Time, LogLine)] {
        &self.log
    }

    /// The drive of that node-ID that the network does not name, if there is one.
    pub fn stranger_of(&self, node: NodeId) -> Option<&Drive> {
        let drives = self.strangers.iter().map(|station| &station.drive);
        drives.into_iter().find(|drive| drive.node() == node)
    }

    /// Where a drive is on its bus, if it is there.
    pub fn drive_port(&self, node: NodeId) -> Option<PortId> {
        let (axis, _) = self.machine.network().find(node)?;
        Some(self.stations[axis].as_ref()?.port)
    }

    /// Where the board is on the first bus.
    pub fn board_port(&self) -> PortId {
        self.lines[FIRST].board
    }

    /// The board measures anew from now on.
    pub fn clear_stats(&mut self) {
        self.board.clear_stats();
    }

    /// The emulated board.
    pub fn board(&self) -> &Board {
        &self.board
    }
}
