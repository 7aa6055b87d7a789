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
