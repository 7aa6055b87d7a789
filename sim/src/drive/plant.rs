//! Motor and load: one inertia, viscous and Coulomb friction with stiction, a
//! band-limited disturbance torque.
//!
//! Torque is in rated torques of the motor, speed in rpm, position in encoder
//! increments. The load is described by what rated torque does to it: the
//! acceleration in rpm/s.

use super::random::Random;
use super::travel::Travel;

/// Integration steps per control cycle of the drive: 0.1 ms each.
const SUB_STEPS: u32 = 4;
/// Seconds in a minute.
const SECONDS_PER_MINUTE: f64 = 60.0;

/// What a motor with its load is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlantConfig {
    /// Encoder increments per turn (four per line).
    pub increments_per_turn: u32,
    /// Acceleration in rpm/s that rated torque gives the nominal inertia.
    pub rated_acceleration: f64,
    /// Inertia over the nominal inertia to which the drive was tuned,
    /// 0.7 ..= 1.3.
    pub inertia_ratio: f64,
    /// Coulomb friction, per mille of rated torque, 20 ..= 50.
    pub friction_permille: f64,
    /// Viscous friction, per mille of rated torque at 1000 rpm.
    pub viscous_permille: f64,
    /// Largest disturbance torque, per mille of rated torque. Below the
    /// Coulomb friction, or a disabled axis would not stand still.
    pub disturbance_permille: f64,
    /// Corner frequency of the disturbance in hertz.
    pub disturbance_hz: f64,
    /// Position at power-on, increments.
    pub start_position: f64,
    /// Torque of the load on the shaft, per mille of rated torque: weight.
    /// Positive drives in the positive direction.
    pub load_permille: f64,
    /// Hard stops, switches, index pulses.
    pub travel: Travel,
}

impl Default for PlantConfig {
    fn default() -> PlantConfig {
        PlantConfig {
            increments_per_turn: 2000,
            rated_acceleration: 25_000.0,
            inertia_ratio: 1.0,
            friction_permille: 35.0,
            viscous_permille: 5.0,
            disturbance_permille: 10.0,
            disturbance_hz: 20.0,
            start_position: 0.0,
            load_permille: 0.0,
            travel: Travel::default(),
        }
    }
}

/// What is true at one moment, whatever the drive reports.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlantState {
    /// Shaft position in increments.
    pub position_inc: f64,
    /// Shaft speed in rpm.
    pub velocity_rpm: f64,
    /// Torque of the motor, in rated torques.
    pub torque: f64,
    /// Way travelled in both directions together, increments.
    pub travelled_inc: f64,
}

/// The motor and its load.
#[derive(Clone, Debug)]
pub struct Plant {
    config: PlantConfig,
    state: PlantState,
    disturbance: f64,
    blocked: bool,
    random: Random,
}

impl Plant {
    /// At rest at the configured position.
    pub fn new(config: PlantConfig, random: Random) -> Plant {
        Plant {
            config,
            state: PlantState {
                position_inc: config.start_position,
                ..PlantState::default()
            },
            disturbance: 0.0,
            blocked: false,
            random,
        }
    }

    /// The present state.
    pub fn state(&self) -> PlantState {
        self.state
    }

    /// The increment that the encoder counts: it is true to half an increment.
    pub fn encoder(&self) -> i64 {
        self.state.position_inc.round() as i64
    }

    /// How it is built.
    pub fn config(&self) -> &PlantConfig {
        &self.config
    }

    /// Another load, per mille of rated torque.
    pub fn set_load(&mut self, permille: f64) {
        self.config.load_permille = permille;
    }

    /// Something blocks the shaft, or lets it go.
    pub fn block(&mut self, blocked: bool) {
        self.blocked = blocked;
    }

    /// One control cycle of `seconds` true time with constant motor torque.
    pub fn step(&mut self, torque: f64, seconds: f64) {
        self.disturb(seconds);
        self.state.torque = torque;
        let dt = seconds / f64::from(SUB_STEPS);
        for _ in 0..SUB_STEPS {
            let load = self.config.load_permille / 1000.0;
            self.sub_step(torque + self.disturbance + load, dt);
        }
    }

    fn sub_step(&mut self, driving: f64, dt: f64) {
        if self.blocked {
            self.state.velocity_rpm = 0.0;
            return;
        }
        let speed = self.state.velocity_rpm;
        let friction = self.config.friction_permille / 1000.0;
        let next = if speed == 0.0 {
            // Stiction: nothing moves below the friction torque.
            if driving.abs() <= friction {
                return;
            }
            (driving - friction.copysign(driving)) * self.gain() * dt
        } else {
            let viscous = self.config.viscous_permille / 1e6 * speed;
            let net = driving - viscous - friction.copysign(speed);
            let next = speed + net * self.gain() * dt;
            // Friction never turns the shaft round: it stops there first.
            if next * speed < 0.0 { 0.0 } else { next }
        };
        let way = (speed + next) / 2.0 * dt / SECONDS_PER_MINUTE
            * f64::from(self.config.increments_per_turn);
        let to = self.state.position_inc + way;
        if let Some(stop) = self.config.travel.stop(to) {
            self.state.travelled_inc += (stop - self.state.position_inc).abs();
            self.state.position_inc = stop;
            self.state.velocity_rpm = 0.0;
            return;
        }
        self.state.position_inc = to;
        self.state.travelled_inc += way.abs();
        self.state.velocity_rpm = next;
    }

    /// rpm/s per rated torque, with the true inertia.
    fn gain(&self) -> f64 {
        self.config.rated_acceleration / self.config.inertia_ratio
    }

    /// White noise through a first-order low pass, bounded.
    fn disturb(&mut self, seconds: f64) {
        let limit = self.config.disturbance_permille / 1000.0;
        let share = (core::f64::consts::TAU * self.config.disturbance_hz * seconds).min(1.0);
        // The root keeps the deviation independent of the step: uniform noise
        // in -1..1 has variance 1/3, so that the limit is three deviations.
        let kick = limit * (2.0 * share / 3.0).sqrt() * self.random.symmetric();
        self.disturbance = (self.disturbance * (1.0 - share) + kick).clamp(-limit, limit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plant(config: PlantConfig) -> Plant {
        Plant::new(config, Random::new(7, 1))
    }

    #[test]
    fn standstill_stands_still() {
        let mut p = plant(PlantConfig::default());
        for _ in 0..100_000 {
            p.step(0.0, 0.0004);
        }
        assert_eq!(p.state().position_inc, 0.0);
        assert_eq!(p.state().velocity_rpm, 0.0);
    }

    #[test]
    fn a_blocked_shaft_does_not_turn() {
        let mut p = plant(PlantConfig::default());
        for _ in 0..100 {
            p.step(1.0, 0.0004);
        }
        p.block(true);
        let at = p.state().position_inc;
        for _ in 0..100 {
            p.step(2.0, 0.0004);
        }
        assert_eq!((p.state().position_inc, p.state().velocity_rpm), (at, 0.0));
        p.block(false);
        p.step(1.0, 0.0004);
        assert!(p.state().velocity_rpm > 0.0);
    }

    #[test]
    fn rated_torque_gives_the_stated_acceleration() {
        let mut p = plant(PlantConfig {
            inertia_ratio: 1.25,
            friction_permille: 0.0,
            viscous_permille: 0.0,
            disturbance_permille: 0.0,
            ..PlantConfig::default()
        });
        for _ in 0..250 {
            p.step(1.0, 0.0004);
        }
        // 0.1 s at 25 000 / 1.25 rpm/s, from rest: half of the end speed times the time.
        let state = p.state();
        assert!((state.velocity_rpm - 2000.0).abs() < 1e-6);
        assert!((state.position_inc - 2000.0 / 60.0 * 0.05 * 2000.0).abs() < 1e-6);
    }

    #[test]
    fn friction_stops_a_coasting_shaft_and_holds_it() {
        let mut p = plant(PlantConfig {
            viscous_permille: 0.0,
            disturbance_permille: 0.0,
            ..PlantConfig::default()
        });
        while p.state().velocity_rpm < 1000.0 {
            p.step(1.0, 0.0004);
        }
        let mut steps = 0;
        while p.state().velocity_rpm > 0.0 {
            p.step(0.0, 0.0004);
            steps += 1;
        }
        // 1000 rpm at 3.5 % of 25 000 rpm/s is 1.14 s.
        let seconds = f64::from(steps) * 0.0004;
        assert!((1.1..1.2).contains(&seconds), "{seconds}");
        let at = p.state().position_inc;
        p.step(0.0, 0.0004);
        assert_eq!(p.state().position_inc, at);
    }

    #[test]
    fn the_disturbance_is_bounded_and_not_nothing() {
        let mut p = plant(PlantConfig::default());
        let mut worst: f64 = 0.0;
        let mut square = 0.0;
        for _ in 0..100_000 {
            p.disturb(0.0004);
            worst = worst.max(p.disturbance.abs());
            square += p.disturbance * p.disturbance;
        }
        let deviation = (square / 100_000.0_f64).sqrt();
        assert!(worst <= 0.010);
        assert!((0.002..0.005).contains(&deviation), "{deviation}");
    }
}
