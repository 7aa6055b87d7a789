//! A random fault at a random moment: a sample of what `cargo xtask campaign
//! --faults` does with 200 seeds.

mod common;

use canmaster_sim::world::strike::Strike;

use common::image;

/// Every second half of a minute has to do: the long list is the campaign's.
const SEEDS: [u64; 10] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10];

#[test]
fn the_contract_for_faults_holds_whatever_happens() {
    let axes = image().machine().network().nodes.len();
    for seed in SEEDS {
        let strike = Strike::random(seed, axes);
        let struck = strike.run(image(), seed);
        assert!(
            struck.is_ok(),
            "seed {seed}, {strike:?}: {}",
            struck.unwrap_err()
        );
    }
}
