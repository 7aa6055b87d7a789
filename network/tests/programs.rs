//! Motion programs: those of the project, their bytes, and what is refused.

use std::path::{Path, PathBuf};

use canmaster::motion::experiment::{self, GROUP, Motor};
use canmaster::motion::{GroupConfig, format};
use canmaster::time::Duration;
use canmaster_network::model::Machine;
use canmaster_network::program::{self, Action, Group, Origin, Program};
use canmaster_network::{Severity, Source, load, read_for_firmware};

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Six axes in cycles of 10 ms.
fn sample() -> Machine {
    machine("networks/one_bus_10ms.toml")
}

fn machine(file: &str) -> Machine {
    load(&workspace().join(file)).machine.unwrap()
}

/// The same six in cycles of 2 ms, as `network.toml` has them.
static FAST: GroupConfig<6> = experiment::group(&[Motor::SAMPLE; 6], Duration::from_millis(2), 3);

fn words(problems: &[canmaster_network::Problem]) -> String {
    let words: Vec<String> = problems.iter().map(ToString::to_string).collect();
    words.join("\n\n")
}

fn of_project(name: &str) -> Program {
    for_machine(name, &sample())
}

fn for_machine(name: &str, machine: &Machine) -> Program {
    let path = workspace().join("programs").join(name);
    let outcome = program::load(&path, machine);
    assert!(outcome.problems.is_empty(), "{}", words(&outcome.problems));
    outcome.program.unwrap()
}

fn compiled(text: &str) -> Program {
    let outcome = program::read(&Source::new("p.toml", text.as_bytes()), &sample());
    assert!(outcome.problems.is_empty(), "{}", words(&outcome.problems));
    outcome.program.unwrap()
}

/// All of them are taken by the firmware's own check.
#[test]
fn the_programs_of_the_project_are_valid() {
    let mut names: Vec<String> = std::fs::read_dir(workspace().join("programs"))
        .unwrap()
        .map(|file| file.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        ["homing.toml", "pairs.toml", "sine.toml", "six_axes.toml"]
    );
    for name in names {
        let program = of_project(&name);
        assert_eq!(format::check(&program.bytes(), &GROUP), Ok(()), "{name}");
        let fast = for_machine(&name, &machine("network.toml"));
        assert_eq!(format::check(&fast.bytes(), &FAST), Ok(()), "{name}");
        let group = Group::of(&sample()).unwrap();
        let course = program.course(&group);
        assert!(!course.endless && course.cycles > 0, "{name}");
    }
}

/// The program that needs no file is the one in the file.
#[test]
fn an_image_without_a_program_runs_the_experiment() {
    let machine = sample();
    let built_in = machine.program.clone().unwrap();
    let written = of_project("pairs.toml");
    assert_eq!(built_in.bytes(), written.bytes());
    assert_eq!(built_in.name, written.name);
}

#[test]
fn golden_bytes_of_the_experiment() {
    let bytes = of_project("pairs.toml").bytes();
    // Version 2, six axes, 216 bytes of steps, cycles of 10 000 us.
    assert_eq!(bytes[..8], [2, 6, 216, 0, 0x10, 0x27, 0, 0]);
    // A move of all six, trapezoid.
    assert_eq!(bytes[8..16], [1, 0, 0x3F, 0, 0, 0, 0, 0]);
    // Axis 1: 40 000, 1200 rpm in set 1, 1500 and 800 rpm/s.
    let axis_1 = [
        0x40, 0x9C, 0, 0, 0xB0, 0x04, 0, 1, 0xDC, 0x05, 0, 0, 0x20, 0x03, 0, 0,
    ];
    assert_eq!(bytes[16..32], axis_1);
    // Axis 2: -32 000, 900 rpm in set 2.
    assert_eq!(bytes[32..40], [0x00, 0x83, 0xFF, 0xFF, 0x84, 0x03, 0, 2]);
    // 50 cycles.
    assert_eq!(bytes[112..120], [2, 0, 0, 0, 50, 0, 0, 0]);
    assert_eq!(bytes[120..128], [1, 0, 0x3F, 0, 0, 0, 0, 0]);
    assert_eq!(bytes.len(), 8 + 216 + 2);
}

/// A sine of 64 points is one shape with an amplitude for each axis.
#[test]
fn a_sine_is_short() {
    let program = of_project("sine.toml");
    let Action::Path(path) = &program.steps[0].action else {
        panic!("{program:?}");
    };
    assert!(path.shared && path.points.len() <= 64);
    assert_eq!(path.periods, 2);
    let cycles: u32 = path.points.iter().map(|p| u32::from(p.cycles)).sum();
    // 180 points, four SYNCs apart.
    assert_eq!(cycles, 4 * 180);
    // Half a period after the start it is twice the amplitude away.
    let half = &path.points[path.points.len() / 2 - 1];
    assert!(
        (path.at(0, half).0 - 4000.0).abs() < 1e-3,
        "{:?}",
        path.at(0, half)
    );
    assert!((path.at(1, half).0 + 2000.0).abs() < 1e-3);
    assert_eq!(path.at(0, path.points.last().unwrap()), (0.0, 0.0));
    assert!(program.bytes().len() < 700, "{}", program.bytes().len());
}

/// The cubics between its points are nowhere farther from the sine than a tenth of
/// an increment.
#[test]
fn error_of_sines() {
    for (points, amplitude) in [(36, 100.0), (180, 2000.0), (500, 9000.0), (4, 2.0)] {
        let program = compiled(&format!(
            "[[step]]\n[step.sine]\naxes = [\"axis 1\"]\namplitude = {amplitude}\npoints = {points}"
        ));
        let Action::Path(path) = &program.steps[0].action else {
            panic!("{program:?}");
        };
        let (mut at, mut speed, mut begin) = (0.0, 0.0, 0.0);
        for point in &path.points {
            let time = f64::from(point.cycles);
            let (to, then) = path.at(0, point);
            for step in 0..=point.cycles {
                let s = f64::from(step) / time;
                let (h1, h2) = ((1.0 + 2.0 * s) * (1.0 - s).powi(2), s * (1.0 - s).powi(2));
                let (h3, h4) = (s * s * (3.0 - 2.0 * s), s * s * (s - 1.0));
                let cubic = h1 * at + h2 * time * speed + h3 * to + h4 * time * then;
                let angle = (begin + f64::from(step)) / f64::from(points) * std::f64::consts::TAU;
                let sine = amplitude * (1.0 - angle.cos());
                assert!((cubic - sine).abs() < 0.1, "{points}: {cubic} {sine}");
            }
            (at, speed, begin) = (to, then, begin + time);
        }
    }
}

#[test]
fn steps_have_the_lines_that_they_come_from() {
    let program = of_project("homing.toml");
    let lines: Vec<Option<u32>> = (0..=10).map(|step| program.line_of(step)).collect();
    let lines: Vec<u32> = lines.into_iter().map(|line| line.unwrap_or(0)).collect();
    // Homing is three steps, a loop its steps and its end.
    assert_eq!(lines, [0, 9, 9, 9, 13, 15, 19, 21, 25, 13, 0]);
}

#[test]
fn the_course_knows_every_rest() {
    let group = Group::of(&sample()).unwrap();
    let course = of_project("pairs.toml").course(&group);
    let targets: Vec<Vec<i32>> = course
        .rests
        .iter()
        .map(|rest| rest.iter().map(|stop| stop.unwrap().target).collect())
        .collect();
    assert_eq!(
        targets,
        [
            vec![40_000, -32_000, 40_000, -32_000, 60_000, 60_000],
            vec![0; 6]
        ]
    );
    let all = course.rests.iter().flatten().flatten();
    assert!(all.into_iter().all(|stop| stop.sure));
    let homing = of_project("homing.toml").course(&group);
    assert_eq!(homing.rests.len(), 4);
    assert!(homing.rests.iter().all(|rest| rest[2].is_none()));
}

/// A sine that turns slowly, or a trapezoid that rests, may be seen to rest there: as
/// it is passed; and the course is not over before.
#[test]
fn the_course_knows_where_a_path_is_slow() {
    let group = Group::of(&sample()).unwrap();
    let stops = |text: &str| {
        let course = compiled(text).course(&group);
        let of_axis = course.rests.iter().filter_map(|rest| rest[2]);
        let of_axis: Vec<_> = of_axis.map(|stop| (stop.target, stop.sure)).collect();
        (of_axis, course.least)
    };
    let sine = |cycles: u32| {
        format!(
            "[[step]]\n[step.sine]\naxes = [\"axis 3\"]\namplitude = 3000\npoints = 36\n\
             cycles = {cycles}\nperiods = 2"
        )
    };
    let (slow, least) = stops(&sine(24));
    let sure: Vec<bool> = slow.iter().map(|stop| stop.1).collect();
    assert_eq!(sure, [false, false, false, true]);
    for (stop, target) in slow.iter().zip([6000, 0, 6000, 0]) {
        assert!((stop.0 - target).abs() <= 15, "{slow:?}");
    }
    assert!((1500..=2 * 36 * 24).contains(&least), "{least}");
    assert_eq!(stops(&sine(4)), (vec![(0, true)], 0));
    let trapezoid = "[[step]]\n[step.trapezoid]\naxes = [\"axis 3\"]\namplitude = 3000\n\
                     ramp_ms = 100\nspeed_ms = 200\nrest_ms = 300";
    assert_eq!(stops(trapezoid).0, [(3000, false), (0, true)]);
}

/// Axes that do the same stop together, unless they end so softly that it cannot be seen.
#[test]
fn axes_of_a_fast_sine_stop_together() {
    let group = Group::of(&sample()).unwrap();
    let together = |cycles: u32| {
        let course = compiled(&format!(
            "[[step]]\n[step.sine]\namplitude = 3000\npoints = 36\ncycles = {cycles}"
        ))
        .course(&group);
        let end = course.rests.last().unwrap();
        end[0].unwrap().set == end[5].unwrap().set
    };
    assert!(together(3));
    assert!(!together(24));
}

/// An axis that a table holds where it is has no rest to be seen.
#[test]
fn what_does_not_move_has_no_rest() {
    let group = Group::of(&sample()).unwrap();
    let table = |points: &str| {
        compiled(&format!(
            "[[step]]\n[step.table]\naxes = [\"axis 1\"]\nevery_ms = 100\npoints = {points}"
        ))
    };
    let course = table("[[0], [0]]").course(&group);
    assert!(course.rests.is_empty());
    assert_eq!((course.least, course.endless), (18, false));
    let moved = table("[[100], [0]]").course(&group);
    assert_eq!(moved.rests.len(), 1);
}

/// A drive in profile position mode goes on to its next set-point during a wait; others
/// have arrived before.
#[test]
fn a_wait_is_a_rest_unless_the_drive_goes_on() {
    let group = Group::of(&sample()).unwrap();
    let sure = |mode: &str| -> Vec<bool> {
        let program = compiled(&format!(
            "velocity = 1000\nacceleration = 5000\n[[step]]\n[step.mode]\nis = \"{mode}\"\n\
             [[step]]\nsettle = false\n[[step.move]]\nto = 5000\n[[step]]\nwait_ms = 300\n\
             [[step]]\n[[step.move]]\nto = 9000\n[[step]]\nwait_ms = 300\n\
             [[step]]\n[[step.move]]\nto = 0\n"
        ));
        let course = program.course(&group);
        course
            .rests
            .iter()
            .map(|rest| rest[0].unwrap().sure)
            .collect()
    };
    assert_eq!(sure("profile position"), [false, true, true]);
    assert_eq!(sure("cyclic synchronous position"), [true; 3]);
}

/// A torque leads anywhere: what follows counts from there, or may be made already.
#[test]
fn a_torque_is_no_rest_and_leads_anywhere() {
    let group = Group::of(&sample()).unwrap();
    let course = compiled(
        "velocity = 600\nacceleration = 6000\n\
         [[step]]\n[[step.move]]\naxes = [\"axis 1\"]\nto = 5000\n\
         [[step]]\n[step.mode]\naxes = [\"axis 1\", \"axis 2\"]\n\
         is = \"cyclic synchronous torque\"\n\
         [[step]]\n[[step.move]]\naxes = [\"axis 1\", \"axis 2\"]\nto = [90, 80]\n\
         [[step.move]]\naxes = [\"axis 3\"]\nto = 4000\n\
         [[step]]\n[[step.move]]\naxes = [\"axis 1\", \"axis 2\"]\nto = 0\n\
         [[step]]\n[step.mode]\naxes = [\"axis 1\", \"axis 2\"]\n\
         is = \"profile velocity\"\n\
         [[step]]\n[[step.move]]\naxes = [\"axis 1\", \"axis 3\"]\nby = 300\n\
         [[step]]\n[[step.move]]\nto = 0\n",
    )
    .course(&group);
    assert!(course.torque);
    let stops = |axis: usize| -> Vec<(i32, Origin)> {
        let of_axis = course.rests.iter().filter_map(|rest| rest[axis]);
        of_axis.map(|stop| (stop.target, stop.origin)).collect()
    };
    let from_anywhere = |by: i32| Origin::HomeFromAnywhere { left: 0, by };
    let home = |target: i32| (target, Origin::Home);
    assert_eq!(
        stops(0),
        [home(5000), (300, Origin::Left(0)), (0, from_anywhere(300))]
    );
    assert_eq!(stops(1), [(0, from_anywhere(0))]);
    assert_eq!(stops(2), [home(4000), home(4300), home(0)]);
    // Nobody knows who of those two goes less far.
    let end = course.rests.last().unwrap();
    assert_ne!(end[0].unwrap().set, end[1].unwrap().set);
    assert!(!of_project("pairs.toml").course(&group).torque);
}

/// 60 per mille at 600 per mille a second: 100 ms.
#[test]
fn a_torque_takes_as_long_as_its_ramp() {
    let group = Group::of(&sample()).unwrap();
    let least = |to: i32| {
        let program = compiled(&format!(
            "velocity = 600\nacceleration = 60_000\n\
             [[step]]\n[step.mode]\nis = \"cyclic synchronous torque\"\n\
             [[step]]\n[[step.move]]\nto = 60\n[[step]]\n[[step.move]]\nto = {to}\n"
        ));
        program.course(&group).least
    };
    let back = least(0) - least(60);
    assert!((8..=12).contains(&back), "{back}");
}

/// Drives in profile position mode make their own ramps: no two of them, and no other
/// axis, have to stop with one.
#[test]
fn a_drive_that_makes_its_own_ramps_stops_for_itself() {
    let group = Group::of(&sample()).unwrap();
    for settle in [true, false] {
        let course = compiled(&format!(
            "velocity = 1000\nacceleration = 5000\n[[step]]\n[step.mode]\n\
             axes = [\"axis 1\", \"axis 2\"]\nis = \"profile position\"\n\
             [[step]]\nsettle = {settle}\n[[step.move]]\nto = 5000\n\
             [[step]]\n[[step.move]]\nto = 0\n"
        ))
        .course(&group);
        for rest in &course.rests {
            let sets: Vec<u8> = rest.iter().map(|stop| stop.unwrap().set).collect();
            assert_eq!(sets, [1, 2, 3, 3, 3, 3], "settle = {settle}");
        }
    }
}

#[test]
fn a_description_names_its_program() {
    let text = std::fs::read_to_string(workspace().join("network.toml")).unwrap();
    let with = |program: &str| {
        let text = format!("{text}\n[group]\nprogram = \"{program}\"\n");
        let source = Source::new("network.toml", text.as_bytes());
        read_for_firmware(&source, &mut |file| std::fs::read(workspace().join(file)))
    };
    let outcome = with("programs/sine.toml");
    assert_eq!(outcome.machine.unwrap().program.unwrap().name, "sine");
    assert!(outcome.files.contains(&"programs/sine.toml".to_string()));
    let outcome = with("programs/nowhere.toml");
    assert!(outcome.machine.is_none());
    assert!(words(&outcome.problems).contains("the motion program cannot be read"));
}

/// Each with the words that a user reads.
#[test]
fn every_broken_program_has_its_message() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs");
    let mut names: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .filter_map(|file| {
            let name = file.unwrap().file_name().into_string().unwrap();
            name.strip_suffix(".toml").map(String::from)
        })
        .collect();
    names.sort();
    assert!(names.len() >= 20, "{}", names.len());
    let machine = sample();
    let mut all = Vec::new();
    for name in names {
        let file = format!("{name}.toml");
        let bytes = std::fs::read(folder.join(&file)).unwrap();
        let outcome = program::read(&Source::new(&file, &bytes), &machine);
        let problems = &outcome.problems;
        let refused = problems.iter().any(|p| p.severity == Severity::Error);
        assert_eq!(outcome.program.is_none(), refused, "{name}");
        assert!(!problems.is_empty(), "{name}");
        all.push(words(problems));
    }
    insta::assert_snapshot!("broken_programs", all.join("\n\n"));
}
