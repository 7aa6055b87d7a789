//! The figures of a run, judged on the bus and in the plant; nothing in here
//! is reported by the firmware about itself.

pub mod arrivals;
pub mod axis;
pub mod bus;
pub mod contract;
pub mod coordination;
pub mod grid;
pub mod lss;
pub mod reaction;
pub mod realtime;
pub mod sdo;
pub mod skew;
pub mod verdict;

pub use arrivals::{Arrival, Assignment, Left, Part, Release, arrivals, matched, worst_pair};
pub use axis::{AxisMonitor, Movement, STANDSTILL_RPM, TracePoint};
pub use bus::{BusFigures, Traffic};
pub use canmaster_network::program::Origin;
pub use contract::{Cause, Limit, Limits, Reaction};
pub use coordination::{Edge, Span};
pub use lss::LssFigures;
pub use realtime::RealTime;
pub use verdict::{ARRIVAL_TOLERANCE, Evidence, Outcome, Verdict, verdict};
