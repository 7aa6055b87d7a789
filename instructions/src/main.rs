//! Calls one hot function of the library so many times. `cargo xtask bench
//! instructions` runs this under Valgrind with two numbers: the difference, divided
//! by the difference of the calls, is what one call takes.
//!
//! Without arguments it names its cases and the two numbers of each.

mod frames;
mod group;
mod pdos;
mod sdo;

use std::process::ExitCode;

/// Something to be called.
struct Case {
    name: &'static str,
    /// How often at least, and how often at most: in a state that does not last,
    /// that is how long it lasts.
    few: u32,
    many: u32,
    /// Prepares and calls it.
    run: fn(u32),
}

const fn case(name: &'static str, (few, many): (u32, u32), run: fn(u32)) -> Case {
    Case {
        name,
        few,
        many,
        run,
    }
}

const CASES: [Case; 22] = [
    case("TxQueue put, six frames", (100, 300), frames::put),
    case("TxQueue put_latest", (100, 300), frames::put_latest),
    case("TxQueue put and next, six", (100, 300), frames::next),
    case("Burst put and next, six", (100, 300), frames::burst_of_six),
    case("frame from bytes", (100, 300), frames::from_bytes),
    case("frame to bytes", (100, 300), frames::to_bytes),
    case("MasterOd store", (100, 300), pdos::store),
    case("MasterOd take_cycle", (100, 300), pdos::take_cycle),
    case("AxisPdos feedback", (100, 300), pdos::feedback),
    case("AxisPdos rpdo", (100, 300), pdos::rpdo),
    case("Group idle", (2, 8), group::idle),
    case("Group enabling", (2, 8), group::enabling),
    case("Group standby", (2, 8), group::standby),
    case("Group release", (0, 1), group::release),
    case("Group moving", (4, 40), group::moving),
    case("Group stopping", (2, 8), group::stopping),
    case("Group fault stop", (2, 8), group::fault_stop),
    case("Group faulted", (2, 8), group::faulted),
    case("SDO client segment down", (10, 60), sdo::client_download),
    case("SDO client segment up", (10, 60), sdo::client_upload),
    case("SDO server segment down", (10, 60), sdo::server_download),
    case("SDO server segment up", (10, 60), sdo::server_upload),
];

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let Some(name) = arguments.next() else {
        for case in &CASES {
            println!("{}\t{}\t{}", case.name, case.few, case.many);
        }
        return ExitCode::SUCCESS;
    };
    let case = CASES.iter().find(|case| case.name == name);
    let times = arguments.next().and_then(|times| times.parse().ok());
    let (Some(case), Some(times)) = (case, times) else {
        eprintln!("usage: NAME TIMES; without arguments the names are listed");
        return ExitCode::FAILURE;
    };
    (case.run)(times);
    ExitCode::SUCCESS
}
