//! A random fault at a random moment: a sample of what `cargo xtask campaign
//! --faults` does with 200 seeds.

mod common;
#[path = "common/ten_ms.rs"]
mod ten_ms;

use canmaster_sim::world::strike::Strike;

use common::image;

/// The first of the campaign's, and four that have found something: a drive drops
/// out in the cycle in which its axis starts (36); one is enabled while its axis
/// still coasts (115); one is bus-off when all are reset (118); one is cut off from
/// the bus while it boots (127).
const SEEDS: [u64; 10] = [1, 2, 3, 4, 5, 6, 36, 115, 118, 127];

#[test]
fn the_contract_for_faults_holds_whatever_happens() {
    let axes = image().machine().network().nodes.len();
    for seed in SEEDS {
        let strike = Strike::random(seed, axes);
        let image = match strike.wants_heartbeats() {
            true => ten_ms::image(),
            false => image(),
        };
        let struck = strike.run(image, seed);
        assert!(
            struck.is_ok(),
            "seed {seed}, {strike:?}: {}",
            struck.unwrap_err()
        );
    }
}
