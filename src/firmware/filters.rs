//! Which frames are received, and what each is: the index of the filter that
//! matched selects the handler.

use crate::derived::NETWORK;
use canmaster::id::{CobId, FunctionCode};
use nucleo_g474re::can::{Fifo, RangeFilter};

/// What a received frame is.
#[derive(Clone, Copy)]
pub(crate) enum Handler {
    /// FIFO 0: a TPDO. The index of its filter is its number, counted from 0.
    Tpdo,
    Emcy,
    /// To something that `sdo_configurator` asked: SDO, LSS.
    Answer,
    /// Boot-up and heartbeat.
    ErrorControl,
    /// For the board itself: an SDO request, TIME, NMT.
    Request,
}

const NODE_MAX: u16 = 127;

/// The identifiers of all 127 nodes: one filter per function code serves any
/// number of drives.
const fn nodes(function: FunctionCode, fifo: Fifo) -> RangeFilter {
    RangeFilter {
        first: function.base() + 1,
        last: function.base() + NODE_MAX,
        fifo,
    }
}

const fn one(identifier: u16) -> RangeFilter {
    RangeFilter {
        first: identifier,
        last: identifier,
        fifo: Fifo::Fifo1,
    }
}

/// The filters. Process data and the rest come through different FIFOs, so that
/// a burst of one does not push out the other.
pub(crate) static FILTERS: [RangeFilter; 9] = [
    nodes(FunctionCode::Tpdo1, Fifo::Fifo0),
    nodes(FunctionCode::Tpdo2, Fifo::Fifo0),
    nodes(FunctionCode::Emcy, Fifo::Fifo1),
    nodes(FunctionCode::SdoResponse, Fifo::Fifo1),
    nodes(FunctionCode::ErrorControl, Fifo::Fifo1),
    one(CobId::of(FunctionCode::SdoRequest, NETWORK.master.node).get()),
    one(CobId::TIME.get()),
    one(CobId::NMT.get()),
    one(CobId::LSS_SLAVE.get()),
];

/// The handler of each filter.
pub(crate) static HANDLERS: [Handler; FILTERS.len()] = [
    Handler::Tpdo,
    Handler::Tpdo,
    Handler::Emcy,
    Handler::Answer,
    Handler::ErrorControl,
    Handler::Request,
    Handler::Request,
    Handler::Request,
    Handler::Answer,
];
