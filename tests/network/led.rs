//! Indicators over whole periods (CiA 303-3).

use canmaster::led::{Colour, Errors, Pattern, Run};
use canmaster::nmt::State;
use canmaster::{Duration, Instant};

/// The times in milliseconds at which the LED changes over two periods.
fn changes(pattern: Pattern, colour: Colour) -> (bool, Vec<u32>) {
    let end = 2 * pattern.period().as_millis().max(1000);
    let lit = |ms: u32| pattern.is_on(colour, Instant::from_micros(u64::from(ms) * 1000));
    let edges = (1..end).filter(|&ms| lit(ms) != lit(ms - 1)).collect();
    (lit(0), edges)
}

#[test]
fn the_patterns() {
    use Colour::{Green, Red};
    for colour in [Green, Red] {
        assert_eq!(changes(Pattern::Off, colour), (false, vec![]));
        assert_eq!(changes(Pattern::On, colour), (true, vec![]));
    }
    assert_eq!(
        changes(Pattern::Flashes(1), Red),
        (true, vec![200, 1200, 1400])
    );
    assert_eq!(
        changes(Pattern::Flashes(2), Red),
        (true, vec![200, 400, 600, 1600, 1800, 2000, 2200])
    );
    assert_eq!(
        changes(Pattern::Flashes(3), Green),
        (
            true,
            vec![200, 400, 600, 800, 1000, 2000, 2200, 2400, 2600, 2800, 3000]
        )
    );
    let (_, quadruple) = changes(Pattern::Flashes(4), Red);
    assert_eq!(quadruple[..8], [200, 400, 600, 800, 1000, 1200, 1400, 2400]);
    let (green, blink) = changes(Pattern::Blinking, Green);
    assert!(green);
    assert_eq!(blink[..4], [200, 400, 600, 800]);
    let (_, flicker) = changes(Pattern::Flickering, Green);
    assert_eq!(flicker[..4], [50, 100, 150, 200]);
}

#[test]
fn periods() {
    for (pattern, ms) in [
        (Pattern::Flickering, 100),
        (Pattern::Blinking, 400),
        (Pattern::Flashes(1), 1200),
        (Pattern::Flashes(2), 1600),
        (Pattern::Flashes(3), 2000),
        (Pattern::Flashes(4), 2400),
    ] {
        assert_eq!(pattern.period(), Duration::from_millis(ms));
    }
}

#[test]
fn red_and_green_alternate() {
    for pattern in [Pattern::Blinking, Pattern::Flickering] {
        for ms in 0..1000 {
            let now = Instant::from_micros(ms * 1000);
            assert_ne!(
                pattern.is_on(Colour::Red, now),
                pattern.is_on(Colour::Green, now)
            );
        }
    }
}

#[test]
fn run_shows_the_state() {
    for (run, pattern) in [
        (Run::Nmt(State::Operational), Pattern::On),
        (Run::Nmt(State::PreOperational), Pattern::Blinking),
        (Run::Nmt(State::Stopped), Pattern::Flashes(1)),
        (Run::Nmt(State::Initialising), Pattern::Off),
        (Run::Download, Pattern::Flashes(3)),
        (Run::Lss, Pattern::Flickering),
    ] {
        assert_eq!(run.pattern(), pattern);
    }
}

#[test]
fn the_worst_error_wins() {
    let mut errors = Errors::default();
    assert_eq!(errors.pattern(), Pattern::Off);
    type Step = (fn(&mut Errors), Pattern);
    let steps: [Step; 7] = [
        (|e| e.configuration = true, Pattern::Blinking),
        (|e| e.warning_limit = true, Pattern::Flashes(1)),
        (|e| e.error_control = true, Pattern::Flashes(2)),
        (|e| e.sync = true, Pattern::Flashes(3)),
        (|e| e.event_timer = true, Pattern::Flashes(4)),
        (|e| e.not_initialised = true, Pattern::Flickering),
        (|e| e.bus_off = true, Pattern::On),
    ];
    for (add, pattern) in steps {
        add(&mut errors);
        assert_eq!(errors.pattern(), pattern);
    }
}
