//! The project's commands. `cargo xtask help` lists them.

mod attach;
mod bench;
mod board_eds;
mod board_names;
mod campaign;
mod capacity;
mod cargo;
mod check;
mod ci;
mod cli;
mod conformance;
mod firmware;
mod frame_pointers;
mod image;
mod interop;
mod machine;
mod networks;
mod new;
mod report;
mod run;
mod size;
mod table;
mod toolchain;

use std::process::ExitCode;

use cli::{Cli, Command};

fn main() -> ExitCode {
    // `| head` closes the pipe: that ends the command, it is no defect to report.
    sigpipe::reset();
    if let Some(code) = frame_pointers::compiler() {
        return code;
    }
    let cli = Cli::parse_or_exit();
    let outcome = match cli.command {
        Command::Run(options) => run::command(&options),
        Command::Test(options) => ci::test(&options),
        Command::Build(options) => firmware::command(&options),
        Command::Size(options) => size::command(&options),
        Command::Flash(options) => attach::flash(&options),
        Command::Attach(options) => attach::attach(&options),
        Command::Check(options) => check::command(&options),
        Command::New(options) => new::command(&options),
        Command::Capacity(options) => capacity::command(&options),
        Command::Interop => interop::command(),
        Command::Ci(options) => ci::command(&options),
        Command::Campaign(options) => campaign::command(&options),
        Command::Bench(options) => bench::command(&options),
    };
    match outcome {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
