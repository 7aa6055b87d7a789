//! What the tasks of a CANopen master share: the transmit queue, the cyclic part
//! of the master's object dictionary, liveness of the TPDOs, the roll call
//! before the watchdog is fed, the debounced button, the clock.
//!
//! All of it is plain data: who may touch it when is the firmware's business.

mod clock;
mod debounce;
mod liveness;
mod od;
mod roll_call;
mod tx_queue;

pub use clock::ExtendedClock;
pub use debounce::Debounce;
pub use liveness::{Liveness, MissingTpdo};
pub use od::{Cycle, MasterOd, Reception, TPDOS_PER_AXIS, TpdoSlot, TpdoSlots};
pub use roll_call::RollCall;
pub use tx_queue::{Overflow, Put, TxQueue};
