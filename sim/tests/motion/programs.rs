//! Every program of the project, loaded over CAN, runs to its end, and each axis
//! comes to rest where the program says, judged in the plant.

use std::fs;
use std::path::{Path, PathBuf};

use canmaster::motion::{GroupState, panel};
use canmaster_network::program::{Action, Program, Stop};
use canmaster_sim::judge::{
    ARRIVAL_TOLERANCE, Arrival, AxisMonitor, Movement, Part, matched, worst_pair,
};
use canmaster_sim::time::Time;
use canmaster_sim::world::{Record, sample};

use crate::leader::{
    AXES, axes, emergencies, in_standby, positions, program, run, until, until_done, written,
};

/// Slower than the program says by so much at most.
const LATE: Time = Time::from_ms(5000);
/// Of position control by speed mode, increments.
const FINAL_ERROR: i64 = 2;
const OVERSHOOT: f64 = 5.0;
/// Where a motion ends softly the moment of standstill is one of noise, too.
const TOGETHER: Time = Time::from_ms(10);

const PROGRAMS: [&str; 4] = ["homing", "pairs", "sine", "six_axes"];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../programs")
}

fn of_project(name: &str) -> Program {
    assert!(PROGRAMS.contains(&name));
    program(&folder().join(name).with_extension("toml"))
}

/// What a program has come to.
struct Ran {
    record: Record,
    /// What it asks for, axis by axis.
    parts: Vec<Vec<(usize, Part)>>,
}

/// Loads and runs it.
fn ran(seed: u64, program: &Program) -> Ran {
    let mut client = in_standby(seed);
    let mut homes = positions(&mut client);
    let group = axes();
    let course = program.course(&group);
    assert!(!course.endless);
    run(&mut client, &program.bytes());
    until(&mut client, GroupState::Moving);
    emergencies(&mut client);
    let takes = Time::from_us(course.cycles * u64::from(group.cycle_us));
    until_done(&mut client, takes + LATE);
    assert_eq!(emergencies(&mut client), []);
    assert_eq!(
        client.number(panel::STEP, 0),
        Ok(0),
        "no step runs any more"
    );
    for axis in 1..=AXES {
        assert_eq!(client.number(panel::FAULT, axis), Ok(0), "axis {axis}");
    }
    let part = |stop: Stop| Part {
        target: stop.target,
        set: stop.set,
        origin: stop.origin,
        sure: stop.sure,
        within: stop.within,
    };
    let of = |axis: usize| {
        let rests = course.rests.iter().enumerate();
        let parts = rests.filter_map(|(step, rest)| Some((step, part(rest[axis]?))));
        parts.collect()
    };
    let parts: Vec<Vec<(usize, Part)>> = (0..usize::from(AXES)).map(of).collect();
    let is_search = |action: &Action| matches!(action, Action::Home { .. });
    if program.steps.iter().any(|step| is_search(&step.action)) {
        // Positions count from there.
        homes.fill(0);
    }
    for (axis, now) in positions(&mut client).into_iter().enumerate() {
        let target = parts[axis].last().map_or(0, |(_, part)| part.target);
        let off = now - homes[axis] - target;
        assert!(
            i64::from(off.abs()) <= FINAL_ERROR,
            "axis {}: {now}",
            axis + 1
        );
    }
    let record = client.world.finish();
    let ran = Ran { record, parts };
    ran.judge();
    ran
}

impl Ran {
    fn motion(&self, axis: usize) -> &AxisMonitor {
        &self.record.axes[axis].motion
    }

    fn home(&self, axis: usize) -> i32 {
        self.record.releases[0].homes[axis]
    }

    /// The movements that an axis made of its parts, with where each had to lead to in
    /// the plant: all of them.
    fn made(&self, axis: usize) -> Vec<(&Movement, usize, Part, i32)> {
        let parts = &self.parts[axis];
        let home = self.home(axis);
        let movements = self.motion(axis).movements().iter();
        let movements = movements.filter(|made| made.release == 1);
        let made = matched(movements, parts, home, true);
        let last = made.last().map(|(_, step, _)| *step);
        assert_eq!(last, parts.last().map(|part| part.0), "axis {}", axis + 1);
        let place = |part: Part| home.wrapping_add(part.target);
        made.into_iter()
            .map(|(movement, step, part)| (movement, step, part, place(part)))
            .collect()
    }

    fn arrivals(&self) -> Vec<Arrival> {
        let mut all = Vec::new();
        for (axis, of) in self.record.axes.iter().enumerate() {
            for (movement, step, part, target) in self.made(axis) {
                all.push(Arrival {
                    node: of.node,
                    axis,
                    release: 1,
                    step,
                    set: part.set,
                    target,
                    error: movement.error(target),
                    stopped: movement.stopped,
                });
            }
        }
        all
    }

    /// Each axis rests where it has to, and those that do the same stop together.
    fn judge(&self) {
        let arrivals = self.arrivals();
        for arrival in &arrivals {
            assert!(arrival.error <= ARRIVAL_TOLERANCE, "{arrival:?}");
        }
        let apart = worst_pair(&arrivals).map_or(Time::ZERO, |pair| pair.0);
        assert!(apart <= TOGETHER, "{apart} s apart");
        for (n, axis) in self.record.axes.iter().enumerate() {
            assert_eq!(axis.motion.unreleased(), None, "axis {}", n + 1);
        }
    }

    /// What position control by speed mode has to reach, with trapezoids.
    fn is_exact(&self) {
        let cycle = Time::from(sample().network().cycle);
        let (apart, ..) = worst_pair(&self.arrivals()).unwrap();
        assert!(apart <= cycle, "{apart} s apart");
        for axis in 0..usize::from(AXES) {
            let made = self.made(axis);
            let mut from = self.home(axis);
            for (n, &(movement, step, _, target)) in made.iter().enumerate() {
                let error = movement.error(target);
                assert!(
                    error <= FINAL_ERROR,
                    "axis {}, step {step}: {error}",
                    axis + 1
                );
                let way = f64::from((target - from).signum());
                let next = made.get(n + 1).map_or(Time::MAX, |next| next.0.started);
                let trace = self.motion(axis).trace().iter();
                let during = trace.filter(|point| (movement.started..next).contains(&point.at));
                let beyond = during.map(|point| (point.position - f64::from(target)) * way);
                let most = beyond.fold(f64::MIN, f64::max);
                assert!(most <= OVERSHOOT, "axis {}, step {step}: {most}", axis + 1);
                from = target;
            }
        }
    }

    /// The lowest and the highest position of an axis, from home.
    fn reach(&self, axis: usize) -> [f64; 2] {
        let home = f64::from(self.home(axis));
        let trace = self.motion(axis).trace().iter();
        trace.fold([0.0, 0.0], |[low, high], point| {
            let at = point.position - home;
            [at.min(low), at.max(high)]
        })
    }
}

#[test]
fn there_are_no_other_programs() {
    let files = fs::read_dir(folder()).unwrap();
    let name = |file: fs::DirEntry| {
        file.path()
            .file_stem()
            .unwrap()
            .to_str()
            .unwrap()
            .to_string()
    };
    let mut names: Vec<String> = files.map(|file| name(file.unwrap())).collect();
    names.sort();
    assert_eq!(names, PROGRAMS);
}

/// S1's experiment.
#[test]
fn motors_in_pairs_arrive_exactly() {
    ran(61, &of_project("pairs")).is_exact();
}

/// All six arrive in one cycle.
#[test]
fn six_motors_in_speed_mode_arrive_exactly_and_together() {
    let program = written(
        "velocity = 1500\nacceleration = 2000\ndeceleration = 1000\n\
         [[step]]\n[[step.move]]\nto = [20_000, -20_000, 20_000, -20_000, 20_000, -20_000]\n\
         [[step]]\nwait_ms = 250\n\
         [[step]]\n[[step.move]]\nto = 0\n",
    );
    for seed in [65, 66] {
        let ran = ran(seed, &program);
        ran.is_exact();
        let arrivals = ran.arrivals();
        assert_eq!(arrivals.len(), 2 * usize::from(AXES));
        // All are compared with each other.
        assert!(arrivals.iter().all(|arrival| arrival.set == 1));
    }
}

#[test]
fn sines_have_their_amplitudes() {
    let ran = ran(62, &of_project("sine"));
    let far = [[0.0, 6000.0]; 4];
    let expected = [[0.0, 4000.0], [-2000.0, 0.0]].into_iter().chain(far);
    for (axis, expected) in expected.enumerate() {
        for (told, wanted) in ran.reach(axis).into_iter().zip(expected) {
            assert!((told - wanted).abs() <= 10.0, "axis {}: {told}", axis + 1);
        }
    }
}

#[test]
fn six_axes_follow_their_path() {
    ran(63, &of_project("six_axes"));
}

#[test]
fn the_search_for_home_and_turns_from_there() {
    ran(64, &of_project("homing"));
}
