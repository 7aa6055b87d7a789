//! The velocity controller of the drive and the plant that it drives.
//!
//! The controller follows the demand through a first-order model whose time
//! constant is the loop's: torque is fed forward for the nominal inertia, and a
//! proportional-integral part, both closed-loop poles at the same time
//! constant, takes out friction, disturbance and the inertia that differs from
//! the nominal one.

use super::plant::{Plant, PlantConfig, PlantState};
use super::random::Random;
use super::travel::{Inputs, Travel};

/// When the axis counts as standing (30E0h).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standstill {
    /// 30E0h:1, rpm.
    pub speed_rpm: f64,
    /// 30E0h:2: for how long the speed has to stay below, seconds.
    pub window_s: f64,
}

impl Standstill {
    /// As the factory sets it.
    pub const DEFAULT: Standstill = Standstill {
        speed_rpm: 30.0,
        window_s: 0.002,
    };
}

/// What the loop follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Follow {
    /// Nothing: the power stage is off.
    Nothing,
    /// A speed, rpm.
    Speed(f64),
    /// A torque, per mille of rated torque.
    Torque(f64),
}

/// Seconds in a minute.
const SECONDS_PER_MINUTE: f64 = 60.0;
/// Averaging time of 30D2h:1 and 30D3h:1, seconds.
const AVERAGING_S: f64 = 0.01;

/// How a drive's velocity loop is set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoConfig {
    /// Time constant of the closed velocity loop in seconds, 0.003 ..= 0.010.
    pub time_constant_s: f64,
    /// Largest torque, per mille of rated torque.
    pub peak_torque_permille: f64,
    /// Noise of 606Ch in rpm, uniform to both sides.
    pub velocity_noise_rpm: f64,
    /// Noise of 6077h, per mille of rated torque, uniform to both sides.
    pub torque_noise_permille: f64,
    /// Current at rated torque, mA.
    pub rated_current_ma: f64,
}

impl Default for ServoConfig {
    fn default() -> ServoConfig {
        ServoConfig {
            time_constant_s: 0.005,
            peak_torque_permille: 2000.0,
            velocity_noise_rpm: 1.0,
            torque_noise_permille: 2.0,
            rated_current_ma: 1000.0,
        }
    }
}

/// What the drive measures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Increments since the encoder was built, not wrapped.
    pub count: i64,
    /// The index pulse that was passed in the last cycle.
    pub index: Option<i64>,
    /// 606Ch, rpm.
    pub velocity: f64,
    /// 30D3h:1, rpm, averaged.
    pub velocity_averaged: f64,
    /// 6077h, per mille of rated torque.
    pub torque: f64,
    /// 30D2h:1, per mille of rated torque, averaged.
    pub torque_averaged: f64,
    /// Speed stayed below the standstill window for its time.
    pub standstill: bool,
}

/// Velocity controller and plant.
#[derive(Clone, Debug)]
pub struct Servo {
    config: ServoConfig,
    /// Rated torques per rpm/s, nominal inertia.
    inertia: f64,
    plant: Plant,
    noise: Random,
    /// Speed of the first-order model, rpm; `None` while the power stage is off.
    model: Option<f64>,
    integral: f64,
    powered: bool,
    quiet_s: f64,
    measured: Measured,
}

impl Servo {
    /// At rest, power stage off.
    pub fn new(config: ServoConfig, plant: PlantConfig, seed: u64) -> Servo {
        let inertia = 1.0 / plant.rated_acceleration;
        let plant = Plant::new(plant, Random::new(seed, super::random::DISTURBANCE));
        let measured = Measured {
            count: plant.encoder(),
            standstill: true,
            ..Measured::default()
        };
        Servo {
            config,
            inertia,
            plant,
            noise: Random::new(seed, super::random::MEASUREMENT),
            model: None,
            integral: 0.0,
            powered: false,
            quiet_s: Standstill::DEFAULT.window_s,
            measured,
        }
    }

    /// What is true.
    pub fn truth(&self) -> PlantState {
        self.plant.state()
    }

    /// The switches.
    pub fn inputs(&self) -> Inputs {
        self.travel().inputs(self.plant.state().position_inc)
    }

    /// Ends and switches of the axis.
    pub fn travel(&self) -> &Travel {
        &self.plant.config().travel
    }

    /// Another load on the shaft, per mille of rated torque.
    pub fn set_load(&mut self, permille: f64) {
        self.plant.set_load(permille);
    }

    /// Something blocks the shaft, or lets it go.
    pub fn block(&mut self, blocked: bool) {
        self.plant.block(blocked);
    }

    /// Increments per second and rpm.
    pub fn per_rpm(&self) -> f64 {
        f64::from(self.plant.config().increments_per_turn) / SECONDS_PER_MINUTE
    }

    /// How the loop is set.
    pub fn config(&self) -> &ServoConfig {
        &self.config
    }

    /// What the drive knows.
    pub fn measured(&self) -> Measured {
        self.measured
    }

    /// Whether the motor had torque in the last cycle.
    pub fn powered(&self) -> bool {
        self.powered
    }

    /// One control cycle. `own_s` is the cycle as the drive's clock has it, `true_s` as it is.
    pub fn step(&mut self, demand: Follow, still: Standstill, own_s: f64, true_s: f64) {
        // The drive divides increments by its own idea of time.
        let seen = self.plant.state().velocity_rpm * true_s / own_s;
        let torque = match demand {
            Follow::Speed(speed) => self.control(speed, seen, own_s),
            Follow::Torque(permille) => {
                self.forget();
                let limit = self.config.peak_torque_permille;
                permille.clamp(-limit, limit) / 1000.0
            }
            Follow::Nothing => {
                self.forget();
                0.0
            }
        };
        self.powered = demand != Follow::Nothing;
        self.plant.step(torque, true_s);
        self.measure(torque, still, own_s, true_s);
    }

    fn forget(&mut self) {
        self.model = None;
        self.integral = 0.0;
    }

    fn control(&mut self, demand: f64, seen: f64, dt: f64) -> f64 {
        let tau = self.config.time_constant_s;
        // Switching on takes the axis over at the speed that it has.
        let before = self.model.unwrap_or(seen);
        let after = demand + (before - demand) * (-dt / tau).exp();
        self.model = Some(after);

        let error = before - seen;
        let feed_forward = self.inertia * (after - before) / dt;
        let proportional = self.inertia * 2.0 / tau * error;
        let limit = self.config.peak_torque_permille / 1000.0;
        let wanted = feed_forward + proportional + self.integral;
        let torque = wanted.clamp(-limit, limit);
        // At the limit the integral would only wind up.
        if torque == wanted {
            self.integral += self.inertia / (tau * tau) * error * dt;
        }
        torque
    }

    fn measure(&mut self, torque: f64, still: Standstill, own_s: f64, true_s: f64) {
        let velocity = self.plant.state().velocity_rpm * true_s / own_s;
        let noisy = velocity + self.config.velocity_noise_rpm * self.noise.symmetric();
        let torque = torque * 1000.0 + self.config.torque_noise_permille * self.noise.symmetric();
        let averaged = |before: f64, now: f64| before + own_s / AVERAGING_S * (now - before);
        self.quiet_s = if velocity.abs() < still.speed_rpm {
            self.quiet_s + own_s
        } else {
            0.0
        };
        let (before, count) = (self.measured.count, self.plant.encoder());
        let turn = self.plant.config().increments_per_turn;
        self.measured = Measured {
            count,
            index: self.travel().index_between(before, count, turn),
            velocity: noisy,
            velocity_averaged: averaged(self.measured.velocity_averaged, noisy),
            torque,
            torque_averaged: averaged(self.measured.torque_averaged, torque),
            standstill: self.quiet_s >= still.window_s,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 0.0004;

    fn servo(tau: f64, inertia_ratio: f64, friction_permille: f64, seed: u64) -> Servo {
        Servo::new(
            ServoConfig {
                time_constant_s: tau,
                ..ServoConfig::default()
            },
            PlantConfig {
                inertia_ratio,
                friction_permille,
                ..PlantConfig::default()
            },
            seed,
        )
    }

    /// Time until 63 % of a step of 50 rpm on top of 1000 rpm.
    fn rise(servo: &mut Servo) -> f64 {
        for _ in 0..2500 {
            servo.step(Follow::Speed(1000.0), Standstill::DEFAULT, DT, DT);
        }
        let mut steps = 0;
        while servo.truth().velocity_rpm < 1000.0 + 50.0 * 0.632 {
            servo.step(Follow::Speed(1050.0), Standstill::DEFAULT, DT, DT);
            steps += 1;
        }
        f64::from(steps) * DT
    }

    #[test]
    fn the_loop_has_its_time_constant_whatever_the_inertia() {
        for tau in [0.003, 0.005, 0.010] {
            for ratio in [0.7, 1.0, 1.3] {
                let seen = rise(&mut servo(tau, ratio, 35.0, 3));
                assert!(
                    (0.6 * tau..1.6 * tau).contains(&seen),
                    "{tau} {ratio}: {seen}"
                );
            }
        }
    }

    #[test]
    fn zero_demand_ends_in_a_true_standstill() {
        for seed in 0..20 {
            for (tau, ratio, friction) in [(0.003, 0.7, 20.0), (0.010, 1.3, 50.0)] {
                let mut s = servo(tau, ratio, friction, seed);
                for _ in 0..1000 {
                    s.step(Follow::Speed(1500.0), Standstill::DEFAULT, DT, DT);
                }
                for _ in 0..2500 {
                    s.step(Follow::Speed(0.0), Standstill::DEFAULT, DT, DT);
                }
                let stopped = s.truth();
                for _ in 0..25_000 {
                    s.step(Follow::Speed(0.0), Standstill::DEFAULT, DT, DT);
                }
                let creep = s.truth().travelled_inc - stopped.travelled_inc;
                assert!(creep < 0.5, "seed {seed} tau {tau}: {creep} increments");
                assert!(s.measured().standstill);
            }
        }
    }

    #[test]
    fn constant_demand_is_held_on_average() {
        let mut s = servo(0.010, 1.3, 50.0, 9);
        for _ in 0..2500 {
            s.step(Follow::Speed(-2000.0), Standstill::DEFAULT, DT, DT);
        }
        let from = s.truth().position_inc;
        for _ in 0..25_000 {
            s.step(Follow::Speed(-2000.0), Standstill::DEFAULT, DT, DT);
        }
        let way = s.truth().position_inc - from;
        let exact = -2000.0 / 60.0 * 2000.0 * 10.0;
        assert!((way - exact).abs() < 20.0, "{way} {exact}");
    }

    #[test]
    fn without_power_the_axis_coasts_and_the_loop_forgets() {
        let mut s = servo(0.005, 1.0, 20.0, 2);
        for _ in 0..2500 {
            s.step(Follow::Speed(600.0), Standstill::DEFAULT, DT, DT);
        }
        s.step(Follow::Nothing, Standstill::DEFAULT, DT, DT);
        assert!(s.truth().velocity_rpm > 590.0);
        assert_eq!(s.truth().torque, 0.0);
        s.step(Follow::Speed(600.0), Standstill::DEFAULT, DT, DT);
        assert!(s.truth().torque.abs() < 0.1, "no jump when switched on");
    }

    #[test]
    fn reported_velocity_is_within_its_noise() {
        let mut s = servo(0.005, 1.0, 35.0, 4);
        for _ in 0..1000 {
            s.step(Follow::Nothing, Standstill::DEFAULT, DT, DT);
            assert!(s.measured().velocity.abs() <= 1.0);
        }
    }

    #[test]
    fn a_fast_clock_measures_a_slower_motor() {
        let mut s = servo(0.005, 1.0, 35.0, 5);
        let true_s = DT * (1.0 - 1e-4);
        for _ in 0..50_000 {
            s.step(Follow::Speed(3000.0), Standstill::DEFAULT, DT, true_s);
        }
        // Its second is shorter, so that it turns faster than it believes.
        let velocity = s.truth().velocity_rpm;
        assert!((velocity - 3000.3).abs() < 5.0, "{velocity}");
    }
}
