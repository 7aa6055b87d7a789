//! The commands as they are typed.

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
        &["run", "--bridge", "localhost:2000"],
        &["run", "--fault", "3:loud"],
        &["campaign", "--seeds", "0"],
        &["size", "now"],
        &["new"],
        &["capacity", "--fast"],
        &["bench"],
        &["bench", "fast"],
        &["bench", "sdo", "--seed", "x"],
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
