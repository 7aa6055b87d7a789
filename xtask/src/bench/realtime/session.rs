//! One run of a scenario.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use canmaster::NodeId;
use canmaster::id::Address;
use canmaster::sdo::Protocol;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Client, Image, World};
use indicatif::ProgressBar;

use super::case::Case;
use super::figures::{Figures, Measured};
use super::own::{Counters, Own};
use crate::machine::{Checked, Description};

/// All axes turn by then.
const MOVING_BY: Time = Time::from_ms(10_000);
/// Lines of the log that are shown when they do not.
const LAST_WORDS: usize = 20;
/// How often the bar is moved.
const LOOK: Time = Time::from_ms(20);
/// 1F22h, concise DCF: the largest objects of the board, one of each node.
const CONCISE_DCF: u16 = 0x1F22;

/// What is run.
pub(crate) struct Built {
    pub(crate) image: Image,
    /// SYNC and the PDOs of every cycle at worst, on the fullest bus.
    pub(crate) wire_bound_us: u32,
}

impl Built {
    /// Builds the image of a description.
    pub(crate) fn new(description: &Path) -> Result<Built> {
        let machine = Description::check(Some(description))?.machine;
        let bounds = machine
            .buses
            .iter()
            .map(|bus| bus.layout.demand.wire_bound_us());
        Ok(Built {
            image: Checked::read(Some(description))?.built()?,
            wire_bound_us: bounds.max().unwrap_or(0),
        })
    }
}

/// Boots the machine, lets it move, and looks at `span` of it.
pub(crate) fn run(
    case: &Case,
    built: &Built,
    seed: u64,
    span: Time,
    bar: &ProgressBar,
) -> Result<Figures> {
    let scenario = case.scenario(built.image.machine(), seed);
    let mut world =
        World::new(&built.image, scenario).context("the emulated board cannot boot this image")?;
    bar.set_length(span.as_ms());
    bar.set_position(0);
    bar.set_message(format!("{}, seed {seed}: booting", case.name));
    if !world.run_to(MOVING_BY, World::in_full_motion) {
        let skipped = world.log().len().saturating_sub(LAST_WORDS);
        let words = world.log().iter().skip(skipped);
        let words: Vec<String> = words.map(|(_, line)| line.to_string()).collect();
        let (at, words) = (world.now(), words.join("\n"));
        bail!("the axes do not turn at {at} s; the firmware's last words:\n{words}");
    }
    let master = world.machine().network().master.node;
    let mut client = Client::new(world, master);
    let before = client.world.now();
    let counters = match case.asked {
        true => Some(Counters::begin(&mut client)?),
        false => None,
    };
    client.world.clear_stats();
    let started = Instant::now();
    let from = client.world.now();
    let to = from + span;
    bar.set_message(format!("{}, seed {seed}", case.name));
    let mut outsider = case.disturbed.then(|| Outsider::new(&client.world));
    while client.world.now() < to {
        match &mut outsider {
            Some(outsider) => outsider.read(&mut client),
            None => {
                let next = (client.world.now() + LOOK).min(to);
                client.world.run_until(next);
            }
        }
        bar.set_position((client.world.now() - from).as_ms());
    }
    let to = client.world.now();
    let wall_s = started.elapsed().as_secs_f64();
    let stats = client.world.board().stats();
    let (own, after) = match counters {
        Some(counters) => {
            let (own, after) = Own::read(&mut client, counters)?;
            (Some(own), after)
        }
        None => (None, to),
    };
    let (transfers, refused) = outsider
        .map(|outsider| (outsider.transfers, outsider.refused))
        .unwrap_or_default();
    let measured = Measured {
        record: client.world.finish(),
        span: Span {
            before,
            from,
            to,
            after,
        },
        stats,
        own,
        wire_bound_us: built.wire_bound_us,
        wall_s,
        outside_transfers: transfers,
        refused,
    };
    Ok(Figures::new(case, &measured))
}

/// What is looked at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    /// The board may have begun anew from then on, and has at `from`.
    pub(super) before: Time,
    pub(super) from: Time,
    pub(super) to: Time,
    /// Between `to` and then the board has said what it measured.
    pub(super) after: Time,
}

/// Somebody who reads the board's dictionary by block transfer, over and over.
struct Outsider {
    nodes: Vec<NodeId>,
    transfers: usize,
    refused: Vec<String>,
}

impl Outsider {
    fn new(world: &World<'_>) -> Outsider {
        let network = world.machine().network();
        Outsider {
            nodes: network.nodes.iter().map(|node| node.id).collect(),
            transfers: 0,
            refused: Vec::new(),
        }
    }

    /// The next object.
    fn read(&mut self, client: &mut Client<'_>) {
        let turn = self.transfers % self.nodes.len();
        let at = Address::new(CONCISE_DCF, self.nodes[turn].get());
        if let Err(error) = client.read(at, Protocol::Block) {
            self.refused
                .push(format!("reading {at} of the board: {error}"));
        }
        self.transfers += 1;
    }
}
