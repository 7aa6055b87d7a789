//! The commands as they are typed.

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use serde_json::Value;

fn xtask() -> Command {
    Command::cargo_bin("xtask").unwrap()
}

#[test]
fn bad_input_ends_with_usage_and_exit_code_two() {
    for bad in [
        &["run", "--fast"][..],
        &["run", "--seconds", "ten"],
        &["run", "--seconds", "0"],
        &["run", "--seed", "-1"],
        &["run", "--without", "0"],
        &["run", "--without", "128"],
        &["run", "--without", "77"],
        &["run", "--log", "loud"],
        &["run", "--bridge", "65536"],
        &["run", "--bridge", "0", "--program", "programs/sine.toml"],
        &["run", "--bridge", "localhost:2000"],
        &["run", "--fault", "3:loud"],
        &["campaign", "--seeds", "0"],
        &["campaign", "--faults", "--seconds", "5"],
        &["size", "now"],
        &["new"],
        &["capacity", "--fast"],
        &["bench"],
        &["bench", "fast"],
        &["bench", "sdo", "--seed", "x"],
        &["bench", "realtime", "--scenario", "ten_buses"],
        &["bench", "realtime", "--seeds", "0"],
        &["bench", "realtime", "--seconds", "0"],
        &["fly"],
        &[],
    ] {
        let assert = xtask().args(bad).assert().code(2);
        let words = String::from_utf8_lossy(&assert.get_output().stderr).to_lowercase();
        assert!(words.contains("usage"), "{bad:?}: {words}");
        assert!(assert.get_output().stdout.is_empty(), "{bad:?}");
    }
}

#[test]
fn the_sample_is_checked_and_its_files_are_derived() {
    let assert = xtask().arg("check").assert().code(0);
    let words = String::from_utf8_lossy(&assert.get_output().stdout).into_owned();
    assert!(words.contains("the smallest cycle that fits"), "{words}");
    assert!(words.contains("6 nodes, 0 warnings"), "{words}");
}

#[test]
fn the_layout_of_every_bus_is_one_json_object() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../networks/two_bus_1ms.toml");
    let assert = xtask().args(["check", "--json"]).arg(file).assert().code(0);
    let text = String::from_utf8_lossy(&assert.get_output().stdout).into_owned();
    let report: Value = serde_json::from_str(&text).unwrap();
    let buses = report["buses"].as_array().unwrap();
    assert_eq!(buses.len(), 2);
    for bus in buses {
        assert_eq!(bus["rpdos"], "after SYNC");
        assert_eq!(bus["wire_bound_us"], 745);
        assert_eq!(bus["sdo"]["until_us"], 845);
        assert_eq!(bus["slots"][0]["kind"], "sync");
    }
}

#[test]
fn a_machine_from_the_sample_is_all_right_until_it_is_broken() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("mine");
    xtask().arg("new").arg(&dir).assert().code(0);
    let file = dir.join("network.toml");
    xtask().arg("check").arg(&file).assert().code(0);
    let assert = xtask().arg("new").arg(&dir).assert().code(1);
    let words = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
    assert!(words.contains("exists already"), "{words}");

    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replace("Target velocity", "Target velocty")).unwrap();
    let assert = xtask().arg("check").arg(&file).assert().code(1);
    let words = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
    assert!(
        words.contains("did you mean \"Target velocity\""),
        "{words}"
    );
}

fn stderr(assert: &assert_cmd::assert::Assert) -> String {
    String::from_utf8_lossy(&assert.get_output().stderr).into_owned()
}

/// A machine from the sample with its text changed, in a folder of its own.
fn machine(folder: &tempfile::TempDir, name: &str, change: impl Fn(String) -> String) -> PathBuf {
    let dir = folder.path().join(name);
    xtask().arg("new").arg(&dir).assert().code(0);
    let file = dir.join("network.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, change(text)).unwrap();
    file
}

#[test]
fn a_machine_that_cannot_work_is_refused_in_the_same_words_before_anything_is_built() {
    let folder = tempfile::tempdir().unwrap();
    let file = machine(&folder, "refused", |text| {
        text.replace("cycle_us = 2_000", "cycle_us = 1_500")
            .replace("\"Statusword\", ", "\"Statusward\", ")
    });
    let checked = stderr(&xtask().arg("check").arg(&file).assert().code(1));
    let text = std::fs::read_to_string(&file).unwrap();
    let line = text.lines().position(|line| line.contains("Statusward"));
    let place = format!("network.toml:{}: `Statusward`", line.unwrap() + 1);
    assert!(checked.contains(&place), "{checked}");
    assert!(checked.ends_with("refused, 1 error\n"), "{checked}");
    for command in ["run", "build", "size", "flash", "attach"] {
        let assert = xtask()
            .args([command, "--network"])
            .arg(&file)
            .env("PATH", "")
            .assert()
            .code(1);
        assert_eq!(stderr(&assert), checked, "{command}");
        assert!(assert.get_output().stdout.is_empty(), "{command}");
    }
}

#[test]
fn a_motion_program_is_refused_with_its_line_before_anything_is_built() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("far.toml");
    let text = "acceleration = 1000\n[[step]]\n[[step.move]]\nto = 5\nvelocity = 5000\n";
    std::fs::write(&file, text).unwrap();
    let assert = xtask().args(["run", "--program"]).arg(&file).assert();
    let words = stderr(&assert.failure());
    assert!(words.contains("far.toml:5: `5000`: velocity of \"axis 1\" must be 1 ..= 3000 rpm"));
    assert!(words.contains("refused, 1 error"), "{words}");
}

#[test]
fn what_is_no_description_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let huge = folder.path().join("huge.toml");
    std::fs::write(&huge, vec![b'#'; 17 << 20]).unwrap();
    let missing = folder.path().join("missing.toml");
    for (path, words) in [
        (folder.path(), "the file cannot be read"),
        (&missing, "the file cannot be read"),
        (&huge, "too large"),
    ] {
        let refused = stderr(&xtask().arg("check").arg(path).assert().code(1));
        assert!(refused.contains(words), "{refused}");
        assert!(refused.contains("refused, 1 error"), "{refused}");
    }
}

/// Other line ends, other node-IDs, fewer drives, another encoder, a gear and
/// limits: what the sample's firmware would not know.
#[test]
fn a_machine_of_ones_own_is_built_and_runs() {
    let folder = tempfile::tempdir().unwrap();
    let file = machine(&folder, "own", |text| {
        let (two, _) = text.split_once("[[node]]\nid = 3").unwrap();
        two.replace("id = 2 ", "id = 99 ")
            .replace("id = 2\n", "id = 99\n")
            .replace("increments_per_turn = 2000", "increments_per_turn = 4096")
            .replace("gear = [1, 1]", "gear = [5, 4]")
            .replace("max_speed = 3_000 ", "max_speed = 600 ")
            .replace("cycle_us = 2_000", "cycle_us = 8_000")
            .replace('\n', "\r\n")
    });
    let assert = xtask()
        .args(["run", "--json", "--network"])
        .arg(&file)
        .assert()
        .code(0);
    let object: Value = serde_json::from_slice(&assert.get_output().stdout).unwrap();
    assert_eq!(object["result"], "ok");
    let period = object["sync"]["period_us"].as_f64().unwrap();
    // The board's crystal is not exact.
    assert!((period - 8000.0).abs() < 2.0, "{period}");
    let drives = object["drives"].as_array().unwrap();
    let nodes: Vec<_> = drives.iter().map(|drive| &drive["node"]).collect();
    assert_eq!(nodes, [1, 99]);
    let arrivals = object["arrivals"].as_array().unwrap();
    // 20 turns of the load.
    assert_eq!(arrivals[0]["target"], 20 * 4096 * 5 / 4);
}

#[test]
fn capacity_prints_one_json_object_with_the_table_of_the_paper() {
    let assert = xtask().args(["capacity", "--json"]).assert().code(0);
    let object: Value = serde_json::from_slice(&assert.get_output().stdout).unwrap();
    let column = |name: &str| -> Vec<u64> {
        let rows = object["rows"].as_array().unwrap();
        rows.iter().map(|row| row[name].as_u64().unwrap()).collect()
    };
    assert_eq!(column("sdo_paper"), [11, 10, 10, 8, 6, 5, 3, 1, 1]);
    assert_eq!(column("pdo_paper"), [127, 127, 127, 99, 49, 39, 19, 7, 3]);
    assert_eq!(
        column("pdo_paper_uncapped"),
        [399, 319, 199, 99, 49, 39, 19, 7, 3]
    );
    assert_eq!(column("pdo_exact_uncapped"), column("pdo_paper_uncapped"));
    assert_eq!(column("bitrate")[0], 1_000_000);
}

#[test]
fn measured_capacity_is_at_least_exact_and_near_what_was_counted() {
    let assert = xtask().args(["capacity", "--measure", "--json"]).assert();
    let assert = assert.code(0);
    let object: Value = serde_json::from_slice(&assert.get_output().stdout).unwrap();
    let rows = object["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 9);
    for row in rows {
        let figure = |name: &str| row[name].as_u64().unwrap();
        for (measured, exact, counted) in [
            ("sdo_measured", "sdo_exact", "sdo_counted"),
            ("pdo_measured", "pdo_exact", "pdo_counted"),
            (
                "pdo_measured_uncapped",
                "pdo_exact_uncapped",
                "pdo_counted_uncapped",
            ),
        ] {
            assert!(figure(measured) >= figure(exact), "{row}");
            assert!(figure(measured).abs_diff(figure(counted)) <= 1, "{row}");
        }
    }
}

#[test]
fn flash_without_probe_rs_says_how_to_install_it() {
    let assert = xtask().arg("flash").env("PATH", "").assert().code(1);
    let words = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
    assert!(words.contains("cargo install probe-rs-tools"), "{words}");
}

#[test]
fn a_run_prints_one_json_object_with_the_documented_names() {
    let assert = xtask()
        .args(["run", "--json", "--seed", "21"])
        .assert()
        .success();
    let object: Value = serde_json::from_slice(&assert.get_output().stdout).unwrap();
    assert_eq!(object["result"], "ok");
    for (name, fields) in [
        (
            "sync",
            &["period_us", "count", "jitter_pp_us", "missed"][..],
        ),
        (
            "bus",
            &["bitrate", "load_mean", "load_max", "frames", "error_frames"],
        ),
        (
            "cpu",
            &[
                "load_mean",
                "sync_isr_worst_cycles",
                "irq_off_max_cycles",
                "stack_high_water_bytes",
            ],
        ),
        ("image", &["flash_bytes", "ram_bytes"]),
        ("startup", &["boot_to_operational_ms", "boot_to_enabled_ms"]),
    ] {
        for field in fields {
            assert!(object[name][field].is_number(), "{name}.{field}: {object}");
        }
    }
    for field in ["reason", "seed", "simulated_s", "wall_s"] {
        assert!(object.get(field).is_some(), "{field}");
    }
    let drives = object["drives"].as_array().unwrap();
    assert_eq!(drives.len(), 6);
    for field in [
        "node",
        "state",
        "target",
        "position",
        "error",
        "stopped_at_us",
        "emcy",
        "travelled",
    ] {
        assert!(
            drives.iter().all(|drive| !drive[field].is_null()),
            "{field}"
        );
    }
    let arrivals = object["arrivals"].as_array().unwrap();
    assert_eq!(arrivals.len(), 12);
    for field in ["node", "target", "error", "stopped_at_us"] {
        assert!(
            arrivals.iter().all(|arrival| arrival[field].is_i64()),
            "{field}"
        );
    }
}

#[test]
fn the_startup_bench_prints_one_json_object_with_the_documented_names() {
    let assert = xtask()
        .args(["bench", "startup", "--json"])
        .assert()
        .success();
    let object: Value = serde_json::from_slice(&assert.get_output().stdout).unwrap();
    assert_eq!(object["result"], "ok");
    let figure = |name: &str| object[name].as_f64().unwrap_or_else(|| panic!("{name}"));
    assert!(figure("ratio") <= 1.3 && figure("ratio") >= 1.0, "{object}");
    assert!(figure("configure_ms") >= figure("wire_bound_ms"));
    assert!(figure("sequential_ms") >= 2.0 * figure("configure_ms"));
}

#[test]
fn the_motion_bench_prints_one_json_object_with_a_row_for_each_mode() {
    let assert = xtask().args(["bench", "motion", "--json"]).assert();
    let object: Value = serde_json::from_slice(&assert.get_output().stdout).unwrap();
    assert_eq!(object["axes"], 6);
    let modes = object["modes"].as_array().unwrap();
    assert_eq!(modes[0]["mode"], "profile velocity");
    for mode in modes {
        let (mean, worst) = (mode["mean"].as_f64(), mode["worst"].as_u64());
        assert!(mean.unwrap() > 0.0 && mean.unwrap() <= worst.unwrap() as f64);
    }
    let slow = modes
        .iter()
        .any(|mode| mode["worst"].as_u64() > Some(10_000));
    assert_eq!(object["result"], if slow { "failed" } else { "ok" });
}

#[test]
fn a_campaign_of_faults_prints_one_json_object() {
    let assert = xtask()
        .args(["campaign", "--faults", "--seeds", "1", "--json"])
        .assert()
        .success();
    let object: Value = serde_json::from_slice(&assert.get_output().stdout).unwrap();
    assert_eq!(
        (&object["result"], &object["seeds"]),
        (&"ok".into(), &1.into())
    );
    let run = &object["runs"][0];
    assert_eq!((&run["seed"], &run["ok"]), (&1.into(), &true.into()));
    for name in ["cause", "phase", "node", "at_s", "allowed_ms", "recovered"] {
        assert!(!run[name].is_null(), "{name}: {run}");
    }
}

#[test]
fn a_run_that_fails_names_the_node_and_ends_with_exit_code_one() {
    let assert = xtask()
        .args(["run", "--json", "--without", "5"])
        .assert()
        .code(1);
    let object: Value = serde_json::from_slice(&assert.get_output().stdout).unwrap();
    assert_eq!(object["result"], "failed");
    assert!(
        object["reason"].as_str().unwrap().contains("node 5"),
        "{object}"
    );
    assert!(object["simulated_s"].as_f64().unwrap() <= 3.0);
    let words = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
    assert!(words.contains("node 5"), "{words}");
}

#[test]
fn a_reader_that_has_seen_enough_is_no_defect() {
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin("xtask"))
        .arg("check")
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let outcome = child.wait_with_output().unwrap();
    assert_eq!(String::from_utf8_lossy(&outcome.stderr), "");
}
