//! The person at the bench: presses the button when the machine stands ready,
//! and again after each round trip, as long as another whole one fits.

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::stimulus::Stimulus;
use crate::time::Time;

/// How long the machine has to stand ready before the button is pressed.
const PATIENCE: Time = Time::from_ms(200);
/// How long it is held down.
const HOLD: Time = Time::from_ms(120);
/// For how long its contacts bounce, at most.
const BOUNCE_US: u64 = 4_000;
/// How often they open and close again, at most.
const BOUNCES: u32 = 6;
/// What has to be left of a run after a round trip, for the last axis to be
/// seen at rest.
const MARGIN: Time = Time::from_ms(300);

/// What the operator sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct View {
    pub(super) now: Time,
    /// All drives are in operation enabled and at rest.
    pub(super) ready: bool,
    /// The longest round trip so far, or what the program needs by its design.
    pub(super) round_trip: Option<Time>,
    /// When everything ends.
    pub(super) end: Time,
}

/// What the operator is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Waiting { ready_since: Option<Time> },
    Watching,
    Retired,
}

/// The person.
#[derive(Clone, Debug)]
pub(super) struct Operator {
    state: State,
    patience: Time,
    random: Pcg64Mcg,
}

impl Operator {
    pub(super) fn new(seed: u64) -> Operator {
        Operator {
            state: State::Waiting { ready_since: None },
            patience: PATIENCE,
            random: Pcg64Mcg::seed_from_u64(seed),
        }
    }

    /// Somebody who presses the button as soon as the machine is at rest.
    pub(super) fn restless(seed: u64) -> Operator {
        Operator {
            patience: Time::ZERO,
            ..Operator::new(seed)
        }
    }

    /// Somebody who never touches anything.
    pub(super) fn absent() -> Operator {
        Operator {
            state: State::Retired,
            ..Operator::new(0)
        }
    }

    /// Looks at the machine. What is done about it is appended with its moment.
    /// True if the button is being pressed now.
    pub(super) fn look(&mut self, view: View, out: &mut Vec<(Time, Stimulus)>) -> bool {
        let State::Waiting { ready_since } = self.state else {
            return false;
        };
        if !view.ready {
            self.state = State::Waiting { ready_since: None };
            return false;
        }
        let since = ready_since.unwrap_or(view.now);
        self.state = State::Waiting {
            ready_since: Some(since),
        };
        if view.now < since + self.patience {
            return false;
        }
        let needed = view.round_trip.unwrap_or(Time::ZERO) + MARGIN;
        if view.now + needed > view.end {
            self.state = State::Retired;
            return false;
        }
        self.state = State::Watching;
        self.press(view.now, out);
        true
    }

    /// The round trip that was watched is over.
    pub(super) fn trip_done(&mut self) {
        if self.state == State::Watching {
            self.state = State::Waiting { ready_since: None };
        }
    }

    /// Presses and lets go, with contacts that bounce.
    pub(super) fn press(&mut self, at: Time, out: &mut Vec<(Time, Stimulus)>) {
        self.contact(at, true, out);
        self.contact(at + HOLD, false, out);
    }

    fn contact(&mut self, at: Time, closed: bool, out: &mut Vec<(Time, Stimulus)>) {
        out.push((at, Stimulus::Button(closed)));
        let bounces = self.random.random_range(0..=BOUNCES);
        let mut moments: Vec<u64> = (0..bounces * 2)
            .map(|_| self.random.random_range(1..BOUNCE_US))
            .collect();
        moments.sort_unstable();
        let states = [!closed, closed].into_iter().cycle();
        out.extend(
            moments
                .into_iter()
                .zip(states)
                .map(|(us, state)| (at + Time::from_us(us), Stimulus::Button(state))),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(ms: u64, ready: bool) -> View {
        View {
            now: Time::from_ms(ms),
            ready,
            round_trip: Some(Time::from_s(3)),
            end: Time::from_s(10),
        }
    }

    #[test]
    fn the_button_is_pressed_once_the_machine_stands_ready() {
        let mut operator = Operator::new(1);
        let mut out = Vec::new();
        assert!(!operator.look(view(1000, false), &mut out));
        assert!(!operator.look(view(1100, true), &mut out));
        assert!(!operator.look(view(1200, false), &mut out));
        assert!(!operator.look(view(1300, true), &mut out));
        assert!(!operator.look(view(1499, true), &mut out));
        assert!(operator.look(view(1500, true), &mut out));
        assert!(
            !operator.look(view(2000, true), &mut out),
            "one press per trip"
        );
        assert_eq!(
            out.first(),
            Some(&(Time::from_ms(1500), Stimulus::Button(true)))
        );
    }

    #[test]
    fn it_is_let_go_and_ends_where_it_should_whatever_the_bounces() {
        for seed in 0..50 {
            let mut out = Vec::new();
            Operator::new(seed).press(Time::from_ms(10), &mut out);
            out.sort_by_key(|(at, _)| *at);
            let middle = out
                .iter()
                .rfind(|(at, _)| *at < Time::from_ms(100))
                .unwrap();
            assert_eq!(middle.1, Stimulus::Button(true));
            assert_eq!(out.last().unwrap().1, Stimulus::Button(false));
        }
    }

    #[test]
    fn a_trip_that_does_not_fit_is_not_begun() {
        let mut operator = Operator::new(1);
        let mut out = Vec::new();
        operator.look(view(6400, true), &mut out);
        assert!(operator.look(view(6600, true), &mut out));
        operator.trip_done();
        out.clear();
        operator.look(view(9000, true), &mut out);
        assert!(!operator.look(view(9300, true), &mut out));
        assert!(out.is_empty());
    }
}
