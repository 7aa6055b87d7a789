//! Follows the machine: who is enabled, who moves under which release, who
//! has come home.

use crate::drive::cia402::State;
use crate::judge::{AxisMonitor, Left, Movement, Part, Release, TracePoint, matched};
use crate::time::Time;

/// Full motion: all axes turn faster than this, rpm.
const FULL_MOTION_RPM: f64 = 300.0;

/// An axis that starts so soon after a release was taken back may have been told
/// so before: the drives carry out the last command until they miss the master
/// (1016h: 200 ms; the SYNC after it).
pub(super) const LAST_COMMAND: Time = Time::from_ms(250);

/// 6061h: homing.
const HOMING: i8 = 6;
/// Cyclic synchronous torque.
const TORQUE: i8 = 10;
/// What an axis does to find its home, or by torque, counts as released, and as no move.
const NO_MOVE: usize = usize::MAX;

/// Whether this counts as full motion.
pub(super) fn is_full_motion(velocity_rpm: f64) -> bool {
    velocity_rpm.abs() > FULL_MOTION_RPM
}

/// What is true of one axis at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AxisTruth {
    pub(super) position: f64,
    /// 6064h.
    pub(super) actual: i32,
    pub(super) velocity: f64,
    pub(super) operational: bool,
    pub(super) enabled: bool,
    pub(super) state: State,
    /// 6061h.
    pub(super) mode: i8,
}

/// From then on a drive was in this state and mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisState {
    /// Since when.
    pub at: Time,
    /// State of CiA 402.
    pub state: State,
    /// 6061h.
    pub mode: i8,
}

/// When the machine got ready.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Startup {
    /// All drives were in NMT operational for the first time.
    pub operational: Option<Time>,
    /// All drives were in operation enabled for the first time.
    pub enabled: Option<Time>,
}

/// See the module.
#[derive(Clone, Debug)]
pub(super) struct Watch {
    pub(super) axes: Vec<AxisMonitor>,
    pub(super) releases: Vec<Release>,
    pub(super) startup: Startup,
    /// What each drive was in, from change to change.
    pub(super) states: Vec<Vec<AxisState>>,
    /// Moves of one round trip, by axis.
    moves: Vec<Vec<(usize, Part)>>,
    /// As [`crate::judge::Assignment::least`].
    least: Time,
    /// As [`crate::judge::Assignment::torque`].
    torque: bool,
    /// The firmware has said so since the newest release.
    said_done: bool,
    homes: Vec<i32>,
    enabled: Vec<bool>,
    /// Motion is allowed under the newest release.
    released: bool,
    /// When that was taken back.
    revoked_at: Option<Time>,
    /// The axes that have come to rest since: they must not start again.
    spent: Vec<bool>,
    round_trip: Option<Time>,
    full_motion: bool,
}

impl Watch {
    pub(super) fn new(moves: Vec<Vec<(usize, Part)>>) -> Watch {
        let axes = moves.len();
        Watch {
            axes: vec![AxisMonitor::default(); axes],
            releases: Vec::new(),
            startup: Startup::default(),
            states: vec![Vec::new(); axes],
            moves,
            least: Time::ZERO,
            torque: false,
            said_done: false,
            homes: vec![0; axes],
            enabled: vec![false; axes],
            released: false,
            revoked_at: None,
            spent: vec![false; axes],
            round_trip: None,
            full_motion: false,
        }
    }

    /// No round trip is over before it has lasted so long.
    pub(super) fn at_least(self, least: Time) -> Watch {
        Watch { least, ..self }
    }

    /// If axes are driven by torque no round trip is over before the firmware says so.
    pub(super) fn with_torque(self, torque: bool) -> Watch {
        Watch { torque, ..self }
    }

    /// The firmware says that its program is done.
    pub(super) fn say_done(&mut self) {
        self.said_done = true;
    }

    /// Takes in the truth; a drive that is missing has none. True if a round
    /// trip was finished just now.
    pub(super) fn sample(&mut self, at: Time, truth: &[Option<AxisTruth>]) -> bool {
        for (axis, truth) in truth.iter().enumerate() {
            let Some(truth) = truth else { continue };
            let revoked = self.revoked_at.is_some_and(|since| at >= since);
            self.spent[axis] |= revoked && self.axes[axis].at_rest();
            let allowed = self.released && !self.spent[axis];
            let number = match truth.mode {
                HOMING | TORQUE => NO_MOVE,
                _ => self.releases.len(),
            };
            let release = allowed.then_some(number);
            self.axes[axis].sample(
                TracePoint {
                    at,
                    position: truth.position,
                    velocity: truth.velocity,
                },
                release,
            );
            let AxisTruth { state, mode, .. } = *truth;
            let before = self.states[axis].last().map(|last| last.mode);
            if before.is_some_and(|before| before != mode) {
                self.change(axis, at, truth, before);
            }
            let last = self.states[axis].last();
            if last.is_none_or(|last| (last.state, last.mode) != (state, mode)) {
                self.states[axis].push(AxisState { at, state, mode });
            }
            if truth.enabled && !self.enabled[axis] {
                // The increment in which the encoder stands.
                self.homes[axis] = truth.position.floor() as i64 as i32;
            }
            self.enabled[axis] = truth.enabled;
        }
        let all =
            |test: fn(&AxisTruth) -> bool| truth.iter().all(|axis| axis.as_ref().is_some_and(test));
        if self.startup.operational.is_none() && all(|axis| axis.operational) {
            self.startup.operational = Some(at);
        }
        if self.startup.enabled.is_none() && all(|axis| axis.enabled) {
            self.startup.enabled = Some(at);
        }
        self.full_motion |= all(|axis| is_full_motion(axis.velocity));
        self.finish_release(at)
    }

    /// An axis that changes its mode stands: what follows is another movement.
    fn change(&mut self, axis: usize, at: Time, truth: &AxisTruth, before: Option<i8>) {
        self.axes[axis].divide();
        match before {
            Some(HOMING) => self.has_home(axis, truth),
            Some(TORQUE) => {
                if let Some(release) = self.releases.last_mut().filter(|_| self.released) {
                    let position = truth.position.round() as i64 as i32;
                    release.left[axis].push(Left { at, position });
                }
            }
            _ => {}
        }
    }

    /// After its search the moves of an axis count from where its drive shows 0.
    fn has_home(&mut self, axis: usize, truth: &AxisTruth) {
        let home = truth.position.round() as i64 - i64::from(truth.actual);
        self.homes[axis] = home as i32;
        if let Some(release) = self.releases.last_mut().filter(|_| self.released) {
            release.homes[axis] = home as i32;
        }
    }

    /// All drives are enabled and at rest.
    pub(super) fn ready(&self) -> bool {
        let ordered = self.releases.last().is_some_and(|last| last.ordered);
        let free = !self.released || ordered;
        self.enabled.iter().all(|enabled| *enabled) && self.at_rest() && free
    }

    /// No axis moves.
    pub(super) fn at_rest(&self) -> bool {
        self.axes.iter().all(AxisMonitor::at_rest)
    }

    /// Every axis has been in full motion at the same time.
    pub(super) fn full_motion(&self) -> bool {
        self.full_motion
    }

    /// The longest round trip so far.
    pub(super) fn round_trip(&self) -> Option<Time> {
        self.round_trip
    }

    /// The operator lets the machine move.
    pub(super) fn release(&mut self, at: Time) {
        self.allow(at, false);
    }

    /// Another tool lets it move, nobody here knows where to, how often or for how
    /// long: until the next stop.
    pub(super) fn release_by_order(&mut self, at: Time) {
        self.allow(at, true);
    }

    fn allow(&mut self, at: Time, ordered: bool) {
        self.releases.push(Release {
            at,
            homes: self.homes.clone(),
            left: vec![Vec::new(); self.homes.len()],
            done: None,
            revoked: false,
            ordered,
        });
        self.released = true;
        self.said_done = false;
        self.revoked_at = None;
        self.spent.fill(false);
    }

    /// The machine has to come to rest: a stop, a reset, a fault. From `at` on no
    /// axis may start any more.
    pub(super) fn revoke(&mut self, at: Time) {
        if let Some(release) = self.releases.last_mut()
            && (release.done.is_none() || release.ordered)
        {
            release.revoked = true;
            self.revoked_at.get_or_insert(at);
        }
    }

    fn finish_release(&mut self, at: Time) -> bool {
        if !self.released || !self.at_rest() {
            return false;
        }
        let number = self.releases.len();
        let Some(release) = self.releases.last_mut() else {
            return false;
        };
        if release.ordered && !release.revoked {
            let moved = |axis: &AxisMonitor| {
                let last = axis.movements().last();
                last.is_some_and(|movement| movement.release == number)
            };
            if self.axes.iter().any(moved) {
                release.done = Some(at);
            }
            return false;
        }
        if release.revoked {
            self.released = self.revoked_at.is_some_and(|since| at < since);
            return false;
        }
        if at < release.at + self.least || (self.torque && !self.said_done) {
            return false;
        }
        let axes = self.axes.iter().zip(&self.moves).zip(&release.homes);
        for (place, ((axis, all), home)) in axes.enumerate() {
            let movements: Vec<&Movement> = axis.under(number).collect();
            let parts = release.placed(place, all, &movements);
            let made = matched(movements.into_iter(), &parts, *home, true);
            let last = made.last().map(|made| made.1);
            if last != parts.last().map(|part| part.0) {
                return false;
            }
        }
        release.done = Some(at);
        let took = at - release.at;
        self.round_trip = Some(self.round_trip.map_or(took, |longest| longest.max(took)));
        self.released = false;
        true
    }
}

#[cfg(test)]
mod tests {
    use canmaster_network::program::Origin;

    use super::*;

    fn truth(position: f64, velocity: f64) -> Vec<Option<AxisTruth>> {
        vec![Some(AxisTruth {
            position,
            actual: 0,
            velocity,
            operational: true,
            enabled: true,
            state: State::OperationEnabled,
            mode: 3,
        })]
    }

    /// So many moves, wherever they lead.
    fn moves(count: usize) -> Vec<(usize, Part)> {
        let part = Part {
            target: 40,
            origin: Origin::Home,
            set: 1,
            sure: true,
            within: 0,
        };
        (0..count).map(|step| (step, part)).collect()
    }

    /// 200 ms of motion and 300 ms of rest; whether a round trip was finished.
    fn one_move(watch: &mut Watch, start_ms: u64) -> bool {
        (0..500).fold(false, |done, ms| {
            let velocity = if ms < 200 { 900.0 } else { 0.0 };
            done | watch.sample(Time::from_ms(start_ms + ms), &truth(50.9, velocity))
        })
    }

    #[test]
    fn a_round_trip_is_all_moves_and_rest() {
        let mut watch = Watch::new(vec![moves(2)]);
        watch.sample(Time::from_ms(1), &truth(10.7, 0.0));
        assert!(watch.ready());
        assert_eq!(watch.startup.enabled, Some(Time::from_ms(1)));
        watch.release(Time::from_ms(2));
        assert!(!watch.ready());
        assert!(!one_move(&mut watch, 10));
        assert!(!watch.ready(), "half of it is not all");
        assert!(one_move(&mut watch, 1000));
        assert!(watch.ready());
        assert_eq!(watch.releases[0].homes, [10]);
        assert_eq!(watch.axes[0].unreleased(), None);
        assert!(watch.round_trip().is_some() && watch.full_motion());
        one_move(&mut watch, 3000);
        assert!(
            watch.axes[0].unreleased().is_some(),
            "a third move was not asked for"
        );
    }

    #[test]
    fn a_revoked_release_ends_with_standstill() {
        let mut watch = Watch::new(vec![moves(2)]);
        watch.sample(Time::from_ms(1), &truth(0.0, 0.0));
        watch.release(Time::from_ms(2));
        watch.sample(Time::from_ms(3), &truth(0.0, 500.0));
        watch.revoke(Time::from_ms(3));
        one_move(&mut watch, 4);
        assert_eq!(watch.axes[0].unreleased(), None, "it may slow down");
        assert!(watch.releases[0].revoked && watch.releases[0].done.is_none());
        one_move(&mut watch, 1000);
        assert!(watch.axes[0].unreleased().is_some());
    }

    #[test]
    fn an_axis_at_rest_must_not_start_while_another_still_coasts() {
        let mut watch = Watch::new(vec![moves(2); 2]);
        let both = |a, b| [truth(0.0, a), truth(0.0, b)].concat();
        watch.sample(Time::from_ms(1), &both(0.0, 0.0));
        watch.release(Time::from_ms(2));
        for ms in 3..400 {
            watch.sample(Time::from_ms(ms), &both(0.0, 500.0));
            if ms == 10 {
                watch.revoke(Time::from_ms(200));
            }
        }
        assert!(watch.axes.iter().all(|axis| axis.unreleased().is_none()));
        watch.sample(Time::from_ms(400), &both(20.0, 400.0));
        assert!(watch.axes[0].unreleased().is_some());
        assert!(watch.axes[1].unreleased().is_none(), "it coasts");
    }

    #[test]
    fn what_was_told_before_the_revocation_may_still_start() {
        let mut watch = Watch::new(vec![moves(2)]);
        watch.sample(Time::from_ms(1), &truth(0.0, 0.0));
        watch.release(Time::from_ms(2));
        watch.revoke(Time::from_ms(50));
        watch.sample(Time::from_ms(49), &truth(0.0, 100.0));
        watch.sample(Time::from_ms(60), &truth(0.0, 50.0));
        assert_eq!(watch.axes[0].unreleased(), None);
    }

    #[test]
    fn an_order_allows_motion_until_the_next_stop() {
        let mut watch = Watch::new(vec![moves(2)]);
        watch.sample(Time::from_ms(1), &truth(0.0, 0.0));
        watch.release_by_order(Time::from_ms(2));
        for start_ms in [10, 1000, 2000] {
            one_move(&mut watch, start_ms);
            assert!(watch.ready());
        }
        assert_eq!(watch.axes[0].unreleased(), None);
        assert!(watch.releases[0].done.is_some());
        watch.revoke(Time::from_ms(2600));
        watch.sample(Time::from_ms(2700), &truth(0.0, 0.0));
        one_move(&mut watch, 3000);
        assert!(watch.axes[0].unreleased().is_some());
    }

    #[test]
    fn a_slow_turning_point_is_not_the_end_and_what_follows_the_end_is_unreleased() {
        let part = |target, sure| Part {
            target,
            origin: Origin::Home,
            set: 1,
            sure,
            within: 20,
        };
        let parts = [part(40, false), part(40, true)];
        let parts = parts.into_iter().enumerate().collect();
        let mut watch = Watch::new(vec![parts]).at_least(Time::from_ms(900));
        watch.sample(Time::from_ms(1), &truth(10.7, 0.0));
        watch.release(Time::from_ms(2));
        assert!(!one_move(&mut watch, 10));
        assert!(one_move(&mut watch, 600));
        assert_eq!(watch.axes[0].unreleased(), None);
        one_move(&mut watch, 2000);
        assert!(watch.axes[0].unreleased().is_some());
    }

    #[test]
    fn a_missing_drive_keeps_the_machine_from_being_ready() {
        let mut watch = Watch::new(vec![moves(2); 2]);
        let mut all = truth(0.0, 0.0);
        all.push(None);
        watch.sample(Time::from_ms(1), &all);
        assert!(!watch.ready());
        assert_eq!(watch.startup, Startup::default());
    }

    /// It turns in this mode for 200 ms and has stood for less than it takes to be seen
    /// when the mode changes.
    fn shortly(watch: &mut Watch, start_ms: u64, position: f64, mode: i8) -> bool {
        (0..290).fold(false, |done, ms| {
            let velocity = if ms < 200 { 900.0 } else { 0.0 };
            let mut truth = truth(position, velocity);
            truth[0].as_mut().unwrap().mode = mode;
            done | watch.sample(Time::from_ms(start_ms + ms), &truth)
        })
    }

    #[test]
    fn a_torque_is_no_move_and_its_end_is_when_the_firmware_says_so() {
        let part = |target, origin| Part {
            target,
            origin,
            set: 1,
            sure: true,
            within: 0,
        };
        let from_anywhere = Origin::HomeFromAnywhere { left: 0, by: 500 };
        let parts = [part(500, Origin::Left(0)), part(0, from_anywhere)];
        let parts = parts.into_iter().enumerate().collect();
        let mut watch = Watch::new(vec![parts]).with_torque(true);
        watch.sample(Time::from_ms(1), &truth(10.0, 0.0));
        watch.release(Time::from_ms(2));
        shortly(&mut watch, 10, 7000.0, TORQUE);
        let at = Time::from_ms(300);
        watch.sample(at, &truth(7000.0, 0.0));
        let position = 7000;
        assert_eq!(watch.releases[0].left, [[Left { at, position }]]);
        shortly(&mut watch, 301, 7500.0, 3);
        let rest = |watch: &mut Watch, ms| watch.sample(Time::from_ms(ms), &truth(10.0, 0.0));
        let mut other = truth(7500.0, 0.0);
        other[0].as_mut().unwrap().mode = 1;
        watch.sample(Time::from_ms(599), &other);
        shortly(&mut watch, 600, 10.0, 1);
        assert!(!rest(&mut watch, 1000), "nobody has said so");
        watch.say_done();
        assert!(rest(&mut watch, 1001));
        assert_eq!(watch.axes[0].movements().len(), 3);
        assert_eq!(watch.axes[0].unreleased(), None);
    }

    #[test]
    fn a_search_for_home_is_no_move_and_its_end_is_the_new_home() {
        let mut watch = Watch::new(vec![moves(1)]);
        let at = |position: f64, velocity, mode, actual| {
            let mut truth = truth(position, velocity);
            let axis = truth[0].as_mut().unwrap();
            (axis.mode, axis.actual) = (mode, actual);
            truth
        };
        watch.sample(Time::from_ms(1), &at(10.0, 0.0, 3, 10));
        watch.release(Time::from_ms(2));
        for ms in 3..300 {
            let velocity = if ms < 100 { 90.0 } else { 0.0 };
            watch.sample(Time::from_ms(ms), &at(5000.0, velocity, HOMING, 20));
        }
        assert!(!watch.ready(), "its move is still to come");
        watch.sample(Time::from_ms(300), &at(5000.2, 0.0, 3, 20));
        assert_eq!(watch.releases[0].homes, [4980]);
        assert!(one_move(&mut watch, 400));
        assert_eq!(watch.axes[0].unreleased(), None);
    }
}
