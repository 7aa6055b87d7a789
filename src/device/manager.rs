//! 1F22h ..= 1F8Ah: the NMT master and configuration manager (CiA 302-2,
//! CiA 302-3), and the manufacturer's objects 2F00h ..= 2FFFh.

use super::found::{Found, Item, Lookup, per_node, variable};
use super::index;
use super::node_record::HISTORY;
use super::settings::{RESTORE_ALL, Setting, nodes};
use crate::id::NodeId;
use crate::network::{Identity, Network};
use crate::od::{Access, DataType};
use crate::sdo::AbortCode;

/// The sub-index that means all nodes.
const ALL: u8 = 0x80;

pub(super) fn find<const N: usize>(network: &'static Network, at: u16, sub: u8) -> Lookup {
    use DataType::{Unsigned8, Unsigned32, VisibleString};
    let expected = |value: fn(&Identity) -> Option<u32>| {
        per_node(sub, |node| {
            let value = network.find(node).and_then(|(_, n)| value(&n.identity));
            Found::number(Unsigned32, value.unwrap_or(0))
        })
    };
    match at {
        index::CONCISE_DCF => per_node(sub, |node| {
            Found::with(DataType::Domain, Access::Constant, Item::ConciseDcf(node))
        }),
        index::CONFIGURE => per_node_and_all(sub, |node| {
            Found::with(Unsigned32, Access::WriteOnly, Item::Configure(node))
        }),
        // The network names no date: its nodes are configured at every start.
        index::EXPECTED_DATE | index::EXPECTED_TIME => {
            per_node(sub, |_| Found::number(Unsigned32, 0))
        }
        index::NMT_STARTUP => variable(sub, Found::setting(Setting::Startup)),
        index::SLAVE_ASSIGNMENT => per_node(sub, |node| match network.find(node) {
            Some((place, _)) if place < usize::from(nodes::<N>(network)) => {
                Found::setting(Setting::Assignment(place as u8))
            }
            _ => Found::number(Unsigned32, 0),
        }),
        index::REQUEST_NMT => per_node_and_all(sub, |node| {
            let access = match node {
                Some(_) => Access::ReadWrite,
                None => Access::WriteOnly,
            };
            Found::with(Unsigned8, access, Item::NmtRequest(node))
        }),
        index::EXPECTED_TYPE => expected(|identity| identity.device_type),
        index::EXPECTED_VENDOR => expected(|identity| identity.vendor),
        index::EXPECTED_PRODUCT => expected(|identity| identity.product),
        index::EXPECTED_REVISION => expected(|identity| identity.revision),
        index::EXPECTED_SERIAL => expected(|identity| identity.serial),
        index::BOOT_TIME => variable(sub, Found::setting(Setting::BootTime)),
        index::RESTORE_CONFIGURATION => per_node(sub, |node| {
            let restore = network.find(node).map_or(0, |_| u32::from(RESTORE_ALL));
            Found::number(Unsigned8, restore)
        }),
        index::BOOT_LETTER => per_node(sub, |node| {
            Found::with(Unsigned8, Access::ReadOnly, Item::BootLetter(node))
        }),
        index::BOOT_WORDS => per_node(sub, |node| {
            Found::with(VisibleString, Access::ReadOnly, Item::BootWords(node))
        }),
        index::EMCY_WORDS => per_node(sub, |node| {
            Found::with(VisibleString, Access::ReadOnly, Item::EmcyWords(node))
        }),
        index::CLOCK => variable(
            sub,
            Found::with(DataType::TimeOfDay, Access::ReadWrite, Item::Clock),
        ),
        index::TIME_PERIOD => variable(sub, Found::setting(Setting::TimePeriod)),
        index::EMCY_HISTORY..=index::EMCY_HISTORY_LAST => {
            let node = NodeId::new((at - index::EMCY_HISTORY) as u8)
                .filter(|node| network.find(*node).is_some())
                .ok_or(AbortCode::NO_SUCH_OBJECT)?;
            match sub.checked_sub(1) {
                None => {
                    let count = Item::EmcyCount(node);
                    Ok(Found::with(Unsigned8, Access::ReadWrite, count).limited(0, 0))
                }
                Some(age) if usize::from(age) < HISTORY => Ok(Found::with(
                    DataType::Unsigned64,
                    Access::ReadOnly,
                    Item::EmcyField(node, age),
                )),
                Some(_) => Err(AbortCode::NO_SUCH_SUB_INDEX),
            }
        }
        _ => Err(AbortCode::NO_SUCH_OBJECT),
    }
}

/// The same as [`per_node`], with all of them at 80h.
fn per_node_and_all(sub: u8, found: impl FnOnce(Option<NodeId>) -> Found) -> Lookup {
    match sub {
        0 => Ok(Found::highest(ALL)),
        ALL => Ok(found(None)),
        _ => per_node(sub, |node| found(Some(node))),
    }
}
