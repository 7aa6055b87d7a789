//! A random fault at a random moment: a sample of what `cargo xtask campaign
//! --faults` does with 200 seeds.

mod common;
#[path = "common/ten_ms.rs"]
mod ten_ms;

use canmaster::motion::GroupState;
use canmaster_sim::world::strike::Strike;

use common::image;

/// Of the campaign's: one for each state of the group in which something can happen to
/// it.
const SEEDS: [u64; 10] = [1, 185, 16, 117, 138, 4, 56, 108, 8, 59];
/// What they hit.
const STATES: [GroupState; 10] = [
    GroupState::Idle,
    GroupState::Enabling,
    GroupState::Standby,
    GroupState::Moving,
    GroupState::Stopping,
    GroupState::Halt,
    GroupState::Homing,
    GroupState::ModeChange,
    GroupState::QuickStop,
    GroupState::Disabling,
];
/// Where the button leads the group, four that have found something: a drive drops
/// out in the cycle in which its axis starts (36); one is enabled while its axis
/// still coasts (115); one is bus-off when all are reset (118); one is cut off from
/// the bus while it boots (127).
const BY_BUTTON: [u64; 4] = [36, 115, 118, 127];

#[test]
fn the_contract_for_faults_holds_whatever_happens() {
    let hit = SEEDS.map(|seed| strike(seed, Strike::random));
    for (seed, (wanted, state)) in SEEDS.into_iter().zip(STATES.into_iter().zip(hit)) {
        assert_eq!(state, wanted, "seed {seed}");
    }
}

#[test]
fn it_holds_where_it_once_did_not() {
    for seed in BY_BUTTON {
        strike(seed, Strike::by_button);
    }
}

/// The state of the group in which it came.
fn strike(seed: u64, draw: fn(u64, usize) -> Strike) -> GroupState {
    let strike = draw(seed, image().machine().network().nodes.len());
    let image = match strike.wants_heartbeats() {
        true => ten_ms::image(),
        false => image(),
    };
    let (moment, struck) = strike.run(image, seed);
    if let Err(error) = struck {
        panic!("seed {seed}, {strike:?}: {error}");
    }
    moment.unwrap().state
}
