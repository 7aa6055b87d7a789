//! From index and sub-index to what stands behind them.

use super::dictionary::Dictionary;
use super::own_tpdo;
use super::pdo::{Mirrored, Process};
use super::settings::{Setting, nodes};
use super::table::{EACH_NODE, Item, Row, TABLE};
use crate::id::{Address, NodeId};
use crate::od::{Access, DataType, Entry};
use crate::sdo::AbortCode;

/// An entry, and what its value comes from. Filled in where it stands: a copy of it
/// takes more flash than anything that is done with it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub(super) item: Item,
    /// Of an [`Item::Setting`].
    pub(super) setting: Setting,
    pub(super) data_type: DataType,
    pub(super) access: Access,
    pub(super) sub: u8,
    /// Of the object in its row of the table.
    pub(super) place: u16,
    pub(super) at: u16,
    /// The node that the entry is about, if sub-index or index tell one.
    pub(super) node: Option<NodeId>,
}

impl Found {
    pub(super) const NOTHING: Found = Found {
        item: Item::Zero,
        setting: Setting::SyncCobId,
        data_type: DataType::Unsigned8,
        access: Access::Constant,
        sub: 0,
        place: 0,
        at: 0,
        node: None,
    };

    /// Where in a record without gaps it is, counted from 0.
    pub(super) fn n(&self) -> usize {
        usize::from(self.sub).wrapping_sub(1)
    }
}

impl<const N: usize> Dictionary<N> {
    pub(super) fn find(&self, at: Address, found: &mut Found) -> Result<(), AbortCode> {
        let (at, sub) = (at.index.0, at.sub.0);
        let mut highest = None;
        for row in &TABLE {
            let Some(place) = row.place(at) else { continue };
            let node = match row.item {
                Item::EmcyCount | Item::EmcyHistory | Item::Process => place as u8,
                _ => sub,
            };
            *found = Found {
                item: row.item,
                setting: Setting::SyncCobId,
                data_type: row.data_type,
                access: row.access,
                sub,
                place,
                at,
                node: NodeId::new(node),
            };
            let Some(last) = self.last_sub(row, found) else {
                continue;
            };
            if (row.sub..=last).contains(&sub) {
                return Ok(());
            }
            highest = Some(last);
        }
        let last = highest.ok_or(AbortCode::NO_SUCH_OBJECT)?;
        if sub != 0 {
            return Err(AbortCode::NO_SUCH_SUB_INDEX);
        }
        *found = Found {
            item: Item::Highest,
            sub: last,
            ..Found::NOTHING
        };
        Ok(())
    }

    pub(super) fn entry(&self, at: Address) -> Result<Entry, AbortCode> {
        let mut found = Found::NOTHING;
        self.find(at, &mut found)?;
        Ok(Entry::new(found.data_type, found.access))
    }

    /// The last entry of this row that the object has; `None` if there is no such
    /// object. Completes what the table cannot say of the entry, if that exists.
    #[inline(never)]
    fn last_sub(&self, row: &Row, found: &mut Found) -> Option<u8> {
        let network = self.network;
        let nodes = nodes::<N>(network);
        let mut last = row.last_sub;
        match found.item {
            Item::Setting => {
                found.setting = row.setting(found.n() as u8);
                if let Setting::Assignment(of) = &mut found.setting {
                    let place = found.node.and_then(|node| network.find(node));
                    match place {
                        Some((place, _)) if place < usize::from(nodes) => *of = place as u8,
                        _ => {
                            found.item = Item::Zero;
                            found.access = Access::Constant;
                        }
                    }
                }
            }
            Item::SdoClient | Item::SdoClientNode => {
                network.nodes.get(usize::from(found.place))?;
            }
            Item::PdoCobId | Item::PdoTransmission | Item::PdoMapping => {
                let pdo = Mirrored::find(network, found.at)?.pdo;
                if found.item == Item::PdoMapping {
                    last = pdo.mapping.len() as u8;
                }
            }
            Item::OwnTpdo | Item::OwnMapping => {
                let axes = usize::from(nodes);
                own_tpdo::mapped(found.place, 1, axes)?;
                if found.item == Item::OwnMapping
                    && own_tpdo::mapped(found.place, last, axes).is_none()
                {
                    last -= 1;
                }
            }
            Item::EmcyCount | Item::EmcyHistory | Item::Process => {
                let (node, _) = self.node(found.node?)?;
                if found.item == Item::Process {
                    if let Some(process) = Process::find(node, found.sub) {
                        found.data_type = process.data_type();
                    }
                    last = Process::count(node);
                }
            }
            _ => {}
        }
        Some(if last == EACH_NODE { nodes } else { last })
    }

    #[inline(never)]
    pub(super) fn process(&self, found: &Found) -> Option<Process> {
        let (node, _) = self.node(found.node?)?;
        Process::find(node, found.sub)
    }
}
