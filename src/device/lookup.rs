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
    /// The node that the entry is about, if sub-index or index tell one.
    pub(super) node: Option<NodeId>,
    pub(super) at: u16,
}

impl Found {
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
            let node = NodeId::new(match row.item {
                Item::EmcyCount | Item::EmcyHistory | Item::Process => place as u8,
                _ => sub,
            });
            let mut found = Found {
                node,
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
                self.refine(&mut found);
                return Ok(found);
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
                node: None,
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
                network.nodes.get(usize::from(found.place))?;
                Some(last)
            }
            Item::PdoCobId | Item::PdoTransmission | Item::PdoMapping => {
                let pdo = Mirrored::find(network, found.at)?.pdo;
                Some(match found.item {
                    Item::PdoMapping => pdo.mapping.len() as u8,
                    _ => last,
                })
            }
            Item::EmcyCount | Item::EmcyHistory | Item::Process => {
                let (node, _) = self.node(found.node?)?;
                Some(match found.item {
                    Item::Process => Process::count(node),
                    _ => last,
                })
            }
            _ => Some(last),
        }
    }

    /// What the table cannot say of an entry that exists.
    fn refine(&self, found: &mut Found) {
        match found.item {
            Item::Setting(Setting::ConsumerHeartbeat(_)) => {
                found.item = Item::Setting(Setting::ConsumerHeartbeat(found.n() as u8));
            }
            Item::Setting(Setting::Assignment(_)) => {
                let place = found.node.and_then(|node| self.network.find(node));
                match place {
                    Some((place, _)) if place < usize::from(nodes::<N>(self.network)) => {
                        found.item = Item::Setting(Setting::Assignment(place as u8));
                    }
                    _ => {
                        found.item = Item::Zero;
                        found.access = Access::Constant;
                    }
                }
            }
            Item::Process => {
                if let Some(process) = self.process(found) {
                    found.data_type = process.data_type();
                }
            }
            _ => {}
        }
    }

    pub(super) fn process(&self, found: &Found) -> Option<Process> {
        let (node, _) = self.node(found.node?)?;
        Process::find(node, found.sub)
    }
}
