//! 1000h ..= 12FFh: the communication profile of the board (CiA 301, 7.5.2).

use super::found::{Found, Item, Lookup, per_node, variable};
use super::settings::{Setting, nodes};
use super::{Description, index};
use crate::emcy::{ERROR_FIELD, EmcyCobId};
use crate::id::{CobId, FunctionCode, NodeId};
use crate::network::Network;
use crate::nmt::ErrorBehaviour;
use crate::od::{Access, DataType};
use crate::sdo::AbortCode;

/// Bit 31 of a COB-ID: there is none.
const NOT_USED: u32 = 1 << 31;

pub(super) fn find<const N: usize>(
    description: &Description,
    network: &'static Network,
    at: u16,
    sub: u8,
) -> Lookup {
    use DataType::{Unsigned8, Unsigned32};
    let me = network.master.node;
    match at {
        index::DEVICE_TYPE => variable(sub, Found::number(Unsigned32, description.device_type)),
        index::ERROR_REGISTER => variable(sub, live(Unsigned8, Item::ErrorRegister)),
        index::STATUS_REGISTER => variable(sub, live(Unsigned32, Item::Status)),
        index::ERROR_FIELD => match sub.checked_sub(1) {
            // Only 0 can be written, which clears the field.
            None => Ok(Found::with(Unsigned8, Access::ReadWrite, Item::ErrorCount).limited(0, 0)),
            Some(age) if usize::from(age) < ERROR_FIELD => {
                Ok(live(Unsigned32, Item::ErrorField(age)))
            }
            Some(_) => Err(AbortCode::NO_SUCH_SUB_INDEX),
        },
        index::COB_ID_SYNC => variable(sub, Found::setting(Setting::SyncCobId)),
        index::SYNC_PERIOD => variable(sub, Found::setting(Setting::SyncPeriod)),
        index::SYNC_WINDOW => variable(sub, Found::setting(Setting::SyncWindow)),
        index::DEVICE_NAME => variable(sub, Found::text(description.name)),
        index::HARDWARE_VERSION => variable(sub, Found::text(description.hardware)),
        index::SOFTWARE_VERSION => variable(sub, Found::text(description.software)),
        index::STORE_PARAMETERS => command(sub, Item::Save),
        index::RESTORE_PARAMETERS => command(sub, Item::Restore),
        index::COB_ID_TIME => variable(sub, Found::setting(Setting::TimeCobId)),
        index::COB_ID_EMCY => variable(sub, Found::setting(Setting::EmcyCobId)),
        index::EMCY_INHIBIT => variable(sub, Found::setting(Setting::EmcyInhibit)),
        index::CONSUMER_HEARTBEAT => match sub.checked_sub(1) {
            None => Ok(Found::highest(nodes::<N>(network))),
            Some(n) if n < nodes::<N>(network) => Ok(Found::setting(Setting::ConsumerHeartbeat(n))),
            Some(_) => Err(AbortCode::NO_SUCH_SUB_INDEX),
        },
        index::PRODUCER_HEARTBEAT => variable(sub, Found::setting(Setting::ProducerHeartbeat)),
        index::IDENTITY => {
            let identity = &description.identity;
            record(
                sub,
                &[
                    identity.vendor,
                    identity.product,
                    identity.revision,
                    identity.serial,
                ],
            )
        }
        index::SYNC_OVERFLOW => variable(sub, Found::setting(Setting::SyncOverflow)),
        index::VERIFY_CONFIGURATION => match sub {
            0 => Ok(Found::highest(2)),
            1 => Ok(Found::setting(Setting::ConfigurationDate)),
            2 => Ok(Found::setting(Setting::ConfigurationTime)),
            _ => Err(AbortCode::NO_SUCH_SUB_INDEX),
        },
        index::EMCY_CONSUMER => per_node(sub, |node| {
            let cob_id = match network.find(node) {
                Some(_) => EmcyCobId::predefined(node).0,
                None => NOT_USED,
            };
            Found::number(Unsigned32, cob_id)
        }),
        index::ERROR_BEHAVIOUR => {
            match sub {
                0 => Ok(Found::highest(1)),
                1 => Ok(Found::setting(Setting::ErrorBehaviour)
                    .limited(0, i64::from(ErrorBehaviour::MAX))),
                _ => Err(AbortCode::NO_SUCH_SUB_INDEX),
            }
        }
        index::SDO_SERVER => record(sub, &sdo_channel(me)),
        index::SDO_CLIENTS..=index::SDO_CLIENTS_LAST => {
            let node = network.nodes.get(usize::from(at - index::SDO_CLIENTS));
            let node = node.ok_or(AbortCode::NO_SUCH_OBJECT)?.id;
            const SERVER: u8 = 3;
            match sub {
                0 => Ok(Found::highest(SERVER)),
                SERVER => Ok(Found::number(Unsigned8, u32::from(node.get()))),
                _ => record(sub, &sdo_channel(node)),
            }
        }
        _ => Err(AbortCode::NO_SUCH_OBJECT),
    }
}

/// The identifiers of a server: client to server, server to client
/// (CiA 301, 7.5.2.33, 7.5.2.34).
fn sdo_channel(server: NodeId) -> [u32; 2] {
    [FunctionCode::SdoRequest, FunctionCode::SdoResponse]
        .map(|function| u32::from(CobId::of(function, server).get()))
}

/// A record of constant UNSIGNED32.
fn record(sub: u8, values: &[u32]) -> Lookup {
    match sub.checked_sub(1) {
        None => Ok(Found::highest(values.len() as u8)),
        Some(n) => values
            .get(usize::from(n))
            .map(|value| Found::number(DataType::Unsigned32, *value))
            .ok_or(AbortCode::NO_SUCH_SUB_INDEX),
    }
}

fn live(data_type: DataType, item: Item) -> Found {
    Found::with(data_type, Access::ReadOnly, item)
}

/// 1010h and 1011h: sub-index 1, all parameters, is all there is.
fn command(sub: u8, item: Item) -> Lookup {
    match sub {
        0 => Ok(Found::highest(1)),
        1 => Ok(Found::with(DataType::Unsigned32, Access::ReadWrite, item)),
        _ => Err(AbortCode::NO_SUCH_SUB_INDEX),
    }
}
