//! The event loop: the board runs until something else happens, then the bus,
//! then the drives; and now and then the machine is looked at.

use super::line::{Line, Who};
use super::operator::View;
use super::orders::Order;
use super::station::Station;
use super::watch::{AxisTruth, LAST_COMMAND};
use super::{FIRST, Observer, World, enabled, operational};
use crate::board::Stop;
use crate::drive::Drive;
use crate::log::Level;
use crate::time::Time;

/// How often the machine is looked at: truth of the plant, log, operator.
const LOOK: Time = Time::from_us(200);
/// After a complaint of the firmware and standstill, how long it may go on to
/// say why.
const LAST_WORDS: Time = Time::from_ms(200);
/// How the firmware says that a program has come to its end.
const PROGRAM_DONE: &str = "program done";

impl World<'_> {
    /// One step of the event loop, at most until `limit`.
    pub(super) fn step(&mut self, limit: Time, observer: &mut dyn Observer) {
        while let Some(stimulus) = self.agenda.due(self.now) {
            self.apply(stimulus);
        }
        let until = self.next_moment().min(limit).max(self.now);
        let reached = match self.board.run_until(until) {
            Stop::Reached => until,
            // What the board would send has changed: the bus has to know
            // before it goes on.
            Stop::CanChanged => self.board.now().clamp(self.now, until),
            Stop::Fault(report) => {
                self.complained.get_or_insert(self.now);
                self.halted
                    .get_or_insert_with(|| format!("the firmware crashed: {report}"));
                until
            }
        };
        self.now = reached;
        for place in 0..self.lines.len() {
            self.advance_line(place);
        }
        self.advance_drives();
        if self.now >= self.next_look {
            self.next_look = self.now + LOOK;
            self.look(observer);
        }
    }

    /// When something happens next that is not the board's doing.
    fn next_moment(&self) -> Time {
        let deadlines = self.drives().map(|station| station.drive.next_deadline());
        let lines = self.lines.iter().filter_map(|line| line.bus.next_event());
        [self.agenda.next(), Some(self.next_look)]
            .into_iter()
            .flatten()
            .chain(lines)
            .chain(deadlines)
            .min()
            .unwrap_or(self.next_look)
    }

    /// Every drive on the bus, those of no network too.
    fn drives(&self) -> impl Iterator<Item = &Station> {
        self.stations.iter().flatten().chain(&self.strangers)
    }

    fn advance_line(&mut self, place: usize) {
        let line = &mut self.lines[place];
        line.offer_board(&self.board, self.now);
        line.bus.advance(self.now, &mut self.events);
        if self.events.is_empty() {
            return;
        }
        for event in self.events.drain(..) {
            let station = match line.who(event.port) {
                Who::Board => {
                    line.tell_board(&mut self.board, &event);
                    continue;
                }
                Who::Axis(axis) => self.stations[axis].as_mut(),
                Who::Stranger(number) => self.strangers.get_mut(number),
                Who::Tool => None,
            };
            if let Some(station) = station {
                station.drive.on_event(&event);
                continue;
            }
            if let Some(bridge) = &mut self.bridge {
                bridge.on_event(&event);
            }
            if let Some(guest) = &mut self.guest {
                guest.on_event(&event);
            }
        }
        line.offer_board(&self.board, self.now);
    }

    fn advance_drives(&mut self) {
        for station in drives(&mut self.stations, &mut self.strangers) {
            station.advance(&mut self.lines[station.line].bus, self.now);
        }
        self.offer_tools();
    }

    fn offer_tools(&mut self) {
        let first = &mut self.lines[FIRST].bus;
        if let Some(bridge) = &mut self.bridge {
            bridge.offer(first, self.now);
        }
        if let Some(guest) = &mut self.guest {
            guest.offer(first, self.now);
        }
    }

    fn look(&mut self, observer: &mut dyn Observer) {
        self.lines.iter_mut().for_each(Line::read);
        self.read_log(observer);
        match self.orders.read(&self.lines[FIRST].wire) {
            Some(Order::Release) => self.watch.release_by_order(self.now),
            Some(Order::Stop) => self.watch.revoke(self.now + LAST_COMMAND),
            None => {}
        }
        for station in drives(&mut self.stations, &mut self.strangers) {
            // Control cycles that nobody waits for have not been worked out yet.
            station.drive.advance(self.now);
        }
        let truth: Vec<Option<AxisTruth>> = self
            .stations
            .iter()
            .map(|station| station.as_ref().map(|station| axis_truth(&station.drive)))
            .collect();
        if self.watch.sample(self.now, &truth) {
            self.operator.trip_done();
        }
        if self.watch.full_motion() {
            for stimulus in std::mem::take(&mut self.in_motion) {
                self.apply(stimulus);
            }
        }
        self.operate();
        observer.look(self);
        if let Some(bridge) = &mut self.bridge {
            bridge.exchange(self.now);
            bridge.offer(&mut self.lines[FIRST].bus, self.now);
        }
    }

    fn read_log(&mut self, observer: &mut dyn Observer) {
        self.rtt.clear();
        self.board.drain_rtt(&mut self.rtt);
        self.decoder.decode(&self.rtt, &mut self.told);
        for line in self.told.drain(..) {
            observer.log(self.now, &line);
            if line.level == Some(Level::Error) && self.complained.is_none() {
                self.complained = Some(self.now);
                self.watch.revoke(self.now + LAST_COMMAND);
            }
            if line.message == PROGRAM_DONE {
                self.watch.say_done();
            }
            self.log.push((self.now, line));
        }
    }

    fn operate(&mut self) {
        let view = View {
            now: self.now,
            ready: self.watch.ready(),
            round_trip: self
                .watch
                .round_trip()
                .or_else(|| self.machine.round_trip()),
            end: self.scenario.end,
        };
        let mut presses = Vec::new();
        if self.operator.look(view, &mut presses) {
            self.watch.release(self.now);
        }
        for (at, stimulus) in presses {
            self.agenda.add(at, stimulus);
        }
    }

    /// Nothing more is to be expected.
    pub(super) fn over(&self) -> bool {
        self.bridge.is_none()
            && self
                .complained
                .is_some_and(|since| self.now >= since + LAST_WORDS)
            && self.watch.at_rest()
    }
}

/// See [`World::drives`].
fn drives<'s>(
    stations: &'s mut [Option<Station>],
    strangers: &'s mut [Station],
) -> impl Iterator<Item = &'s mut Station> {
    stations.iter_mut().flatten().chain(strangers)
}

fn axis_truth(drive: &Drive) -> AxisTruth {
    let truth = drive.truth();
    let status = drive.status();
    AxisTruth {
        position: truth.position_inc,
        actual: status.position,
        velocity: truth.velocity_rpm,
        operational: operational(&status),
        enabled: enabled(&status),
        state: status.state,
        mode: status.mode,
    }
}
