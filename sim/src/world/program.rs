//! What the firmware is built to do, in the judge's terms.

use canmaster::motion::Step;
use canmaster::network::Network;
use canmaster::{motion, network};

use crate::judge::{Assignment, Part, Traffic};
use crate::time::Time;

/// The network that the firmware is built for.
pub fn network() -> &'static Network {
    &network::sample::SIX_EPOS4
}

/// The moves that one release makes.
pub fn assignment() -> Assignment {
    let moves = motion::experiment::GROUP
        .program
        .steps
        .iter()
        .filter_map(|step| match step {
            Step::Move(parts) => Some(
                parts
                    .iter()
                    .map(|part| {
                        part.map(|part| Part {
                            target: part.target,
                            set: part.set,
                        })
                    })
                    .collect::<Vec<_>>(),
            ),
            _ => None,
        })
        .collect();
    Assignment {
        moves,
        cycle: Time::from(network().cycle),
    }
}

/// How long the program says that one round trip takes.
pub fn round_trip() -> Option<Time> {
    let group = &motion::experiment::GROUP;
    group.program.duration(group).ok().map(Time::from)
}

/// What has to be on the bus in every cycle.
pub fn traffic() -> Traffic {
    let network = network();
    Traffic {
        bit_rate: network.bit_rate,
        cycle: Time::from(network.cycle),
        nodes: network.nodes.iter().map(|node| node.id).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten turns of 2000 increments.
    const TEN_TURNS: u32 = 20_000;

    #[test]
    fn every_axis_goes_at_least_ten_turns_away_and_comes_back() {
        let assignment = assignment();
        assert_eq!(assignment.moves.len(), 2);
        for (there, back) in assignment.moves[0].iter().zip(&assignment.moves[1]) {
            assert!(there.unwrap().target.unsigned_abs() >= TEN_TURNS);
            assert_eq!(back.unwrap().target, 0);
        }
    }

    #[test]
    fn the_pairs_are_one_and_three_two_and_four_five_and_six() {
        for parts in assignment().moves {
            let sets: Vec<u8> = parts.iter().map(|part| part.unwrap().set).collect();
            assert_eq!(sets, [1, 2, 1, 2, 3, 3]);
        }
    }
}
