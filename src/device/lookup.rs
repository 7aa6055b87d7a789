//! From index and sub-index to what stands behind them.

use super::dictionary::Dictionary;
use super::pdo::{Mirrored, Process};
use super::settings::{Setting, nodes};
use super::table::{Item, Row, TABLE};
use crate::id::{Address, NodeId};
use crate::od::{Access, DataType, Entry};
use crate::sdo::AbortCode;

/// An entry, and what its value comes from.
#[derive(Clone, Copy)]
pub(super) struct Found {
    pub(super) item: Item,
    pub(super) data_type: DataType,
    pub(super) access: Access,
    pub(super) sub: u8,
    /// Of the object in its row of the table.
    pub(super) place: u16,
    pub(super) at: u16,
}

impl Found {
    /// The node that it is about, if it is about one.
    pub(super) fn node(&self) -> Option<NodeId> {
        NodeId::new(match self.item {
            Item::EmcyCount | Item::EmcyHistory | Item::Process => self.place as u8,
            _ => self.sub,
        })
    }

    /// Where in a record without gaps it is, counted from 0.
    pub(super) fn n(&self) -> usize {
        usize::from(self.sub).wrapping_sub(1)
    }
}

impl<const N: usize> Dictionary<N> {
    pub(super) fn find(&self, at: Address) -> Result<Found, AbortCode> {
        let (at, sub) = (at.index.0, at.sub.0);
        let mut highest = None;
        for row in &TABLE {
            let Some(place) = row.place(at) else { continue };
            let found = Found {
                item: row.item,
                data_type: row.data_type,
                access: row.access,
                sub,
                place,
                at,
            };
            let Some(last) = self.last_sub(row, &found) else {
                continue;
            };
            if (row.sub..=last).contains(&sub) {
                return Ok(self.refine(found));
            }
            highest = Some(last);
        }
        match highest {
            None => Err(AbortCode::NO_SUCH_OBJECT),
            Some(last) if sub == 0 => Ok(Found {
                item: Item::Highest,
                data_type: DataType::Unsigned8,
                access: Access::Constant,
                sub: last,
                place: 0,
                at,
            }),
            Some(_) => Err(AbortCode::NO_SUCH_SUB_INDEX),
        }
    }

    pub(super) fn entry(&self, at: Address) -> Result<Entry, AbortCode> {
        let found = self.find(at)?;
        Ok(Entry::new(found.data_type, found.access))
    }

    /// The last entry of this row that the object has; `None` if there is no such
    /// object.
    fn last_sub(&self, row: &Row, found: &Found) -> Option<u8> {
        let network = self.network;
        let last = row.last_sub;
        match found.item {
            Item::Setting(Setting::ConsumerHeartbeat(_)) => Some(nodes::<N>(network)),
            Item::SdoClient | Item::SdoClientNode => {
                let client = network.nodes.get(usize::from(found.place));
                client.map(|_| last)
            }
            Item::PdoCobId | Item::PdoTransmission => {
                Mirrored::find(network, found.at).map(|_| last)
            }
            Item::PdoMapping => {
                let mirrored = Mirrored::find(network, found.at);
                mirrored.map(|mirrored| mirrored.pdo.mapping.len() as u8)
            }
            Item::EmcyCount | Item::EmcyHistory => self.node(found.node()?).map(|_| last),
            Item::Process => self
                .node(found.node()?)
                .map(|(node, _)| Process::count(node)),
            _ => Some(last),
        }
    }

    /// What the table cannot say of an entry that exists.
    fn refine(&self, found: Found) -> Found {
        let place = || Some(self.network.find(found.node()?)?.0);
        let (item, access) = match found.item {
            Item::Setting(Setting::ConsumerHeartbeat(_)) => (
                Item::Setting(Setting::ConsumerHeartbeat(found.n() as u8)),
                found.access,
            ),
            Item::Setting(Setting::Assignment(_)) => {
                match place().filter(|place| *place < usize::from(nodes::<N>(self.network))) {
                    Some(place) => (
                        Item::Setting(Setting::Assignment(place as u8)),
                        found.access,
                    ),
                    None => (Item::Zero, Access::Constant),
                }
            }
            item => (item, found.access),
        };
        let data_type = match item {
            Item::Process => self
                .process(&found)
                .map_or(found.data_type, |process| process.data_type()),
            _ => found.data_type,
        };
        Found {
            item,
            access,
            data_type,
            ..found
        }
    }

    pub(super) fn process(&self, found: &Found) -> Option<Process> {
        let (node, _) = self.node(found.node()?)?;
        Process::find(node, found.sub)
    }
}
