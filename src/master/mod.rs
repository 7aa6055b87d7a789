//! What the tasks of a CANopen master share: the transmit queue, the cyclic part
//! of the master's object dictionary, the PDOs of an axis, the roll call
//! before the watchdog is fed, the supervision of the nodes, the debounced button,
//! the clock.
//!
//! All of it is plain data: who may touch it when is the firmware's business.

mod axis_map;
mod axis_pdo;
mod burst;
mod clock;
mod debounce;
mod od;
mod overload;
mod ramps;
mod roll_call;
mod supervisor;
mod tx_queue;

pub use axis_map::AxisMap;
pub use axis_pdo::AxisPdos;
pub use burst::Burst;
pub use clock::ExtendedClock;
pub use debounce::Debounce;
pub use od::{
    Cycle, IMAGE_BYTES, MasterOd, Reception, TPDOS_PER_AXIS, TpdoSlot, TpdoSlots, WrongLength,
};
pub use overload::Overload;
pub use ramps::{RAMPS_AGAIN, Ramps};
pub use roll_call::RollCall;
pub use supervisor::{Advice, Notice, Report, Supervisor};
pub use tx_queue::{Overflow, Pending, Put, TxQueue, holds, room};
