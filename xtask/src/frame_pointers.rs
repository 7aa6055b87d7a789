//! The image without frame pointers.
//!
//! The compiler's target makes every function keep one: 2.7 KB of flash, one of
//! the eight registers that the short instructions reach, and cycles in each call.
//! Nothing needs them: debuggers, probe-rs among them, go by the DWARF call frame
//! information. No option of the compiler takes them away, but one of LLVM's gives
//! attributes to functions by name. So each crate of the workspace is compiled
//! twice: once quickly, for the names of its functions, which are put beside its
//! output, then for good. A name that is missing there keeps its frame pointer.
//!
//! For that this program stands in for the compiler, as cargo lets it
//! (`RUSTC_WORKSPACE_WRAPPER`). A plain `cargo build` makes the same image, larger.

use std::ffi::{OsStr, OsString};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, ExitStatus, Stdio};
use std::sync::OnceLock;

use anyhow::{Context, Result};
use object::{Object, ObjectSymbol, SymbolKind};

use crate::toolchain;

/// Cargo's variable: who stands in for the compiler in the crates of a workspace.
const WRAPPER: &str = "RUSTC_WORKSPACE_WRAPPER";
/// Tells this program that cargo calls it for the compiler.
const ROLE: &str = "CANMASTER_XTASK_IS_RUSTC";
/// What LLVM says of each name that is no function's: those that it inlined.
const UNKNOWN_NAME: &[u8] = b"Function in CSV file at line";

/// Where this program lay when it was started. A cargo that it runs may put another
/// build of it there meanwhile, which does just as well.
static PROGRAM: OnceLock<Option<PathBuf>> = OnceLock::new();

/// Makes a build of the image leave them out.
pub(crate) fn leave_out(command: &mut Command) {
    // Without it the image is larger, and just as good.
    if let Some(Some(this)) = PROGRAM.get() {
        command.env(WRAPPER, this).env(ROLE, "1");
    }
}

/// Compiles, if this program was called for that. The first thing that it does.
pub(crate) fn compiler() -> Option<ExitCode> {
    PROGRAM.get_or_init(|| std::env::current_exe().ok());
    std::env::var_os(ROLE)?;
    let mut arguments = std::env::args_os().skip(1);
    let rustc = arguments.next()?;
    let arguments: Vec<OsString> = arguments.collect();
    Some(match compile(&rustc, &arguments) {
        Ok(status) => match status.code() {
            Some(code) => ExitCode::from(code as u8),
            None => ExitCode::FAILURE,
        },
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    })
}

fn compile(rustc: &OsStr, arguments: &[OsString]) -> Result<ExitStatus> {
    let mut command = Command::new(rustc);
    command.args(arguments);
    let Some(output) = output(arguments) else {
        return command.status().context("cannot start the compiler");
    };
    // What does not compile says so below.
    if let Some(names) = names(rustc, arguments, &output)? {
        let file = output.with_extension("functions");
        std::fs::write(&file, list(names)).with_context(|| file.display().to_string())?;
        let mut option = OsString::from("-Cllvm-args=-forceattrs-csv-path=");
        option.push(&file);
        command.arg(option);
    }
    let mut child = command
        .stderr(Stdio::piped())
        .spawn()
        .context("cannot start the compiler")?;
    if let Some(said) = child.stderr.take() {
        let mut stderr = std::io::stderr().lock();
        for line in BufReader::new(said).split(b'\n') {
            let line = line?;
            if !line.starts_with(UNKNOWN_NAME) {
                stderr.write_all(&line)?;
                stderr.write_all(b"\n")?;
            }
        }
    }
    child.wait().context("cannot wait for the compiler")
}

/// Where the output of a crate of the image goes, without what comes after its
/// name; nothing, if something else is asked of the compiler.
fn output(arguments: &[OsString]) -> Option<PathBuf> {
    let value = |option: &str| {
        let at = arguments.iter().position(|argument| argument == option)?;
        arguments.get(at + 1)
    };
    let links = |argument: &OsString| {
        let text = argument.to_string_lossy();
        text.strip_prefix("--emit=")
            .is_some_and(|kinds| kinds.split(',').any(|kind| kind == "link"))
    };
    if value("--target")? != toolchain::TARGET || !arguments.iter().any(links) {
        return None;
    }
    let mut name = value("--crate-name")?.clone();
    for argument in arguments {
        if let Some(suffix) = argument.to_string_lossy().strip_prefix("extra-filename=") {
            name.push(suffix);
        }
    }
    Some(Path::new(value("--out-dir")?).join(name))
}

/// The functions of a crate, as its object file has them when nothing is optimised
/// away; nothing, if it does not compile.
fn names(rustc: &OsStr, arguments: &[OsString], output: &Path) -> Result<Option<Vec<String>>> {
    let object = output.with_extension("functions.o");
    let status = Command::new(rustc)
        .args(without_output(arguments))
        .args(["-Copt-level=0", "-Cdebuginfo=0"])
        .args(["-Clto=off", "-Clinker-plugin-lto=no"])
        // The level switches them on, and they are functions of their own.
        .args(["-Cdebug-assertions=off", "-Coverflow-checks=off"])
        .args(["--cap-lints=allow", "--emit=obj", "-o"])
        .arg(&object)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .context("cannot start the compiler")?;
    if !status.success() {
        return Ok(None);
    }
    let bytes = std::fs::read(&object).with_context(|| object.display().to_string())?;
    // Large, and of no more use.
    std::fs::remove_file(&object).with_context(|| object.display().to_string())?;
    functions(&bytes).map(Some)
}

/// The arguments without those that say what to write, and where.
fn without_output(arguments: &[OsString]) -> Vec<&OsString> {
    let mut kept = Vec::new();
    let mut rest = arguments.iter();
    while let Some(argument) = rest.next() {
        let text = argument.to_string_lossy();
        if text == "--out-dir" {
            rest.next();
        } else if !["--emit=", "--error-format=", "--json="]
            .iter()
            .any(|option| text.starts_with(option))
        {
            kept.push(argument);
        }
    }
    kept
}

fn functions(object: &[u8]) -> Result<Vec<String>> {
    let file = object::File::parse(object).context("not an object file")?;
    let mut names: Vec<String> = file
        .symbols()
        .filter(|symbol| symbol.kind() == SymbolKind::Text && symbol.is_definition())
        .filter_map(|symbol| symbol.name().ok().map(String::from))
        .collect();
    names.sort();
    names.dedup();
    Ok(names)
}

/// The file that LLVM reads: function, attribute.
fn list(names: Vec<String>) -> String {
    names
        .iter()
        .map(|name| format!("{name},frame-pointer=none\n"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arguments(line: &str) -> Vec<OsString> {
        line.split(' ').map(OsString::from).collect()
    }

    #[test]
    fn crates_of_the_image_are_told_from_everything_else() {
        let of = |line: &str| output(&arguments(line));
        let image = "--crate-name canmaster src/lib.rs --emit=dep-info,metadata,link \
                     -C extra-filename=-1d23 --out-dir /t/deps --target thumbv7em-none-eabihf";
        assert_eq!(of(image), Some(PathBuf::from("/t/deps/canmaster-1d23")));
        for other in [
            image.replace("thumbv7em-none-eabihf", "x86_64-unknown-linux-gnu"),
            image.replace(",link", ""),
            "-vV".into(),
            "- --crate-name ___ --print=file-names".into(),
        ] {
            assert_eq!(of(&other), None, "{other}");
        }
    }

    #[test]
    fn the_names_are_asked_for_without_other_output() {
        let line = "a.rs --error-format=json --json=artifacts --emit=link -C lto=fat --out-dir /t";
        let all = arguments(line);
        assert_eq!(without_output(&all), ["a.rs", "-C", "lto=fat"]);
    }

    #[test]
    fn the_list_is_a_function_and_its_attribute_in_each_line() {
        let names = ["main", "TIM2"].map(String::from).to_vec();
        let lines = "main,frame-pointer=none\nTIM2,frame-pointer=none\n";
        assert_eq!(list(names), lines);
        assert!(functions(b"hello").is_err());
    }
}
