//! The main job: the image moves six drives in step.

mod common;

use canmaster_sim::bus::log::write_candump;
use canmaster_sim::judge::{ARRIVAL_TOLERANCE, Outcome, worst_pair};
use canmaster_sim::time::Time;
use canmaster_sim::world::{Record, Scenario, World, sample};

use common::image;

/// Start, one round trip and a little more.
fn one_trip() -> Time {
    Time::from_ms(3500) + sample().round_trip().unwrap() + Time::from_ms(500)
}

fn run(scenario: Scenario) -> Record {
    World::new(image(), scenario).unwrap().run(&mut ())
}

fn bus_log(record: &Record) -> Vec<u8> {
    let mut log = Vec::new();
    write_candump(&mut log, "can0", &record.buses[0].wire).unwrap();
    log
}

#[track_caller]
fn assert_good(record: &Record) {
    assert_eq!(
        record.verdict.outcome,
        Outcome::Ok,
        "{}",
        record.verdict.reason
    );
    let axes = sample().network().nodes.len();
    let moves = sample().assignment().moves.len();
    let trips = record.releases.len();
    assert_eq!(record.arrivals.len(), axes * moves * trips);
    assert!(
        record
            .arrivals
            .iter()
            .all(|arrival| arrival.error <= ARRIVAL_TOLERANCE)
    );
    let (apart, ..) = worst_pair(&record.arrivals).unwrap();
    assert!(
        apart <= Time::from(sample().network().cycle),
        "a pair stopped {apart} s apart"
    );
    assert_eq!(record.bus.missed, 0);
    assert_eq!(record.board.rx_overruns, [0; 3]);
    assert!(record.complaints.is_empty(), "{:?}", record.complaints);
    assert_eq!(record.bus.error_frames, 0);
    assert_eq!(record.lss, None, "everybody has a node-ID");
}

#[test]
fn every_move_of_every_drive_arrives() {
    for seed in [1, 2] {
        let record = run(Scenario::new(seed, one_trip()));
        assert_good(&record);
        assert_eq!(record.releases.len(), 1);
        for axis in &record.axes {
            // At least ten turns there, and the same back.
            assert!(axis.motion.travelled() >= 2.0 * 20_000.0);
            assert_eq!(axis.motion.unreleased(), None);
        }
        assert!(record.startup.enabled.unwrap() < Time::from_ms(3500));
    }
}

#[test]
fn the_figures_keep_their_bounds() {
    let record = run(Scenario::new(3, one_trip()));
    assert_good(&record);
    // Sections with interrupts off: logging included.
    assert!(
        record.board.irq_off_max_cycles <= 120,
        "{}",
        record.board.irq_off_max_cycles
    );
    assert!(
        (1_999.6..2_000.4).contains(&record.bus.sync_period_us),
        "{}",
        record.bus.sync_period_us
    );
    assert!(record.bus.load_max < 0.9, "{}", record.bus.load_max);
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    let end = Time::from_ms(2500);
    let [first, again, other] = [7, 7, 8].map(|seed| bus_log(&run(Scenario::new(seed, end))));
    assert!(!first.is_empty());
    assert_eq!(first, again);
    assert_ne!(first, other);
}

#[test]
fn whole_round_trips_are_repeated_as_long_as_they_fit() {
    let two = one_trip() + sample().round_trip().unwrap() + Time::from_ms(1500);
    let record = run(Scenario::new(4, two));
    assert_good(&record);
    assert_eq!(record.releases.len(), 2);
}

#[test]
fn too_short_a_run_is_incomplete_and_nothing_moves() {
    let record = run(Scenario::new(1, Time::from_ms(3500)));
    assert_eq!(record.verdict.outcome, Outcome::Incomplete);
    assert!(
        record.verdict.reason.contains("--seconds"),
        "{}",
        record.verdict.reason
    );
    assert!(
        record
            .axes
            .iter()
            .all(|axis| axis.motion.movements().is_empty())
    );
}

#[test]
fn without_a_release_the_machine_stands_by() {
    let record = run(Scenario::new(5, Time::from_ms(6000)).unattended());
    assert!(record.startup.enabled.is_some());
    let verdict = &record.verdict;
    assert_eq!(verdict.outcome, Outcome::Incomplete, "{}", verdict.reason);
    assert!(
        record
            .axes
            .iter()
            .all(|axis| axis.motion.movements().is_empty())
    );
    assert_eq!(record.bus.missed, 0);
}

#[test]
fn pressing_the_button_in_motion_stops_the_group_into_standby() {
    let mut world = canmaster_sim::world::trials::moving(image(), 6).unwrap();
    world.press();
    let limit = world.now() + Time::from_ms(1500);
    assert!(
        world.run_to(limit, |world| world.at_rest()),
        "the group does not stop"
    );
    let limit = world.now() + Time::from_ms(1000);
    assert!(
        world.run_to(limit, |world| world.ready()),
        "the group is not in standby"
    );
    world.run_until(world.now() + Time::from_ms(500));
    let record = world.finish();
    assert!(
        record
            .axes
            .iter()
            .all(|axis| axis.motion.unreleased().is_none())
    );
    assert!(record.arrivals.is_empty(), "it was stopped on its way");
}

#[test]
fn delaying_sync_tick_raises_the_jitter_by_as_much() {
    use canmaster_sim::board::irqs;
    use canmaster_sim::world::Stimulus;

    /// 100 microseconds at 170 MHz.
    const DELAY_CYCLES: u64 = 17_000;
    const DELAY_US: f64 = 100.0;
    let end = Time::from_ms(4500);
    let calm = run(Scenario::new(9, end).unattended());
    let delay = Stimulus::DelayIrq {
        irq: irqs::TIM2,
        max_cycles: DELAY_CYCLES,
    };
    let shaken = run(Scenario::new(9, end).unattended().at(Time::ZERO, delay));
    let (calm, shaken) = (in_standby(&calm), in_standby(&shaken));
    // Uniform delays do not all reach their limit.
    assert!(
        calm < 2.0 && (DELAY_US * 0.8..DELAY_US * 1.1).contains(&shaken),
        "calm {calm} us, delayed {shaken} us"
    );
}

/// Jitter peak to peak in the second half of a run. Before, while the drives are
/// started, a SYNC that is late may find a frame in its way.
fn in_standby(record: &Record) -> f64 {
    let all = &record.bus.sync_residuals_us;
    let late = &all[all.len() / 2..];
    late.iter().copied().fold(f64::MIN, f64::max) - late.iter().copied().fold(f64::MAX, f64::min)
}
