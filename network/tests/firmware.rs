//! What the firmware of this project cannot do is refused, with the line.

use std::path::{Path, PathBuf};

use canmaster_network::{Source, read_for_firmware};

/// The words about the sample after `from` was replaced by `to`.
fn refused(from: &str, to: &str) -> String {
    let sample = sample();
    assert!(sample.contains(from), "{from}");
    words(&sample.replace(from, to))
}

/// Of 10 ms: it has both TPDOs, and room for more axes.
fn sample() -> String {
    std::fs::read_to_string(folder().join("one_bus_10ms.toml")).unwrap()
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../networks")
}

fn words(text: &str) -> String {
    let source = Source::new("network.toml", text.as_bytes());
    let outcome = read_for_firmware(&source, &mut |file| std::fs::read(folder().join(file)));
    assert_eq!(outcome.machine.is_none(), !outcome.problems.is_empty());
    let words: Vec<String> = outcome.problems.iter().map(|p| p.to_string()).collect();
    words.join("\n\n")
}

#[track_caller]
fn says(from: &str, to: &str, expected: &[&str]) {
    let words = refused(from, to);
    for expected in expected {
        assert!(words.contains(expected), "{words}");
    }
}

#[test]
fn what_an_axis_needs_is_mapped_once() {
    says(
        r#"map = ["Statusword", "Position actual value"]"#,
        r#"map = ["Statusword"]"#,
        &[
            "`6064h:00 \"Position actual value\"`",
            "map it once in TPDO1 or TPDO2",
        ],
    );
    says(
        r#"map = ["Profile acceleration", "Profile deceleration"]"#,
        r#"map = ["Profile acceleration"]"#,
        &["`6084h:00 \"Profile deceleration\"`", "device = \"epos4\""],
    );
}

#[test]
fn an_rpdo_carries_what_the_firmware_writes() {
    says(
        r#"map = ["Profile acceleration", "Profile deceleration"]"#,
        r#"map = ["Profile acceleration", "Profile velocity"]"#,
        &["nothing to write there, and it is in RPDO2"],
    );
    says(
        r#"map = ["Profile acceleration", "Profile deceleration"]"#,
        r#"map = ["Profile acceleration", "Target torque"]"#,
        &[
            "`RPDO2`",
            "one of its pairs",
            "\"Controlword\" and \"Target torque\"",
        ],
    );
    says(
        r#"map = ["Controlword", "Target torque"]"#,
        r#"map = ["Controlword", "Target position"]"#,
        &["`607Ah:00 \"Target position\"`", "map it once"],
    );
}

/// What is not mapped is a mode that the drive does not have.
#[test]
fn modes_without_their_rpdo() {
    let modes = |text: &str| {
        let source = Source::new("network.toml", text.as_bytes());
        let outcome = read_for_firmware(&source, &mut |file| std::fs::read(folder().join(file)));
        outcome.machine.unwrap().nodes[0].motor().unwrap().modes
    };
    let sample = sample();
    assert_eq!(modes(&sample), 0x3A5);
    let torque = "[device.epos4.rpdo.4]\nmap = [\"Controlword\", \"Target torque\"]\n";
    assert!(sample.contains(torque));
    assert_eq!(modes(&sample.replace(torque, "")), 0x1A5);
    let position = "[device.epos4.rpdo.3]\nmap = [\"Controlword\", \"Target position\"]\n";
    let velocity = sample.replace(torque, "").replace(position, "");
    assert_eq!(modes(&velocity), 0x124);
}

#[test]
fn pdos_are_the_first_two_at_every_sync() {
    says(
        "[device.epos4.tpdo.2]",
        "[device.epos4.tpdo.3]",
        &[
            "`TPDO3`",
            "the firmware takes in TPDO1 and TPDO2 of an axis",
        ],
    );
    says("transmission = 1", "transmission = 2", &["at every SYNC"]);
}

#[test]
fn axes_have_an_encoder_and_profile_velocity_mode() {
    says(
        "increments_per_turn = 2000",
        "",
        &["how many increments a turn of \"axis 1\" has"],
    );
    says(
        r#"mode = "profile velocity""#,
        r#"mode = "profile position""#,
        &[
            "`profile position`",
            "leads its axes in profile velocity mode",
        ],
    );
}

/// The unit of speeds, 60A9h, as a start value of the device and of a node.
#[test]
fn another_unit_of_speeds_is_refused() {
    let device = "[[device.epos4.start_values]]";
    assert!(sample().contains(device));
    let tenths = format!("{device}\nobject = \"60A9\"\nvalue = 0xFFB44700\n\n{device}");
    let refusal = "the firmware has speeds in rpm: 60A9h:00 of \"axis 1\" has to be 00B44700h";
    says(
        device,
        &tenths,
        &["`FFB44700h`", refusal, "10^-1: write 0x00B44700"],
    );
    let rpm = tenths.replace("FFB4", "00B4");
    assert_eq!(words(&sample().replacen(device, &rpm, 1)), "");
    // The node goes before its device, and is named with its line.
    let own = "start_values = [{ object = \"60A9\", value = 0xFEB44700 }]";
    let name = "name = \"axis 2\"";
    let text = sample().replacen(name, &format!("{name}\n{own}"), 1);
    let line = text.lines().position(|line| line == own).unwrap() + 1;
    let words = words(&text);
    assert!(
        words.contains("`FEB44700h`") && words.contains("\"axis 2\""),
        "{words}"
    );
    assert!(words.contains(&format!("network.toml:{line}:")), "{words}");
}

#[test]
fn numbers_that_no_axis_can_be_led_with() {
    for (from, to, value, help) in [
        (
            "increments_per_turn = 2000",
            "increments_per_turn = 99",
            "`99`",
            "write at least 100",
        ),
        ("max_speed = 3_000", "max_speed = 59", "`59`", "at least 60"),
        (
            "max_acceleration = 20_000",
            "max_acceleration = 99",
            "`99`",
            "at least 100",
        ),
        (
            "# homing_method = 37",
            "min_position = -2_999\nmax_position = 0 #",
            "`2999`",
            "no room for a turn",
        ),
    ] {
        says(from, to, &[value, help]);
    }
    for (from, to) in [
        ("max_speed = 3_000", "max_speed = 60"),
        (
            "# homing_method = 37",
            "min_position = -3_000\nmax_position = 1 #",
        ),
    ] {
        assert_eq!(refused(from, to), "");
    }
}

#[test]
fn order_and_division_of_the_mapping_are_free_and_torque_may_be_left_out() {
    for (from, to) in [
        (
            r#"map = ["Controlword", "Target velocity"]"#,
            r#"map = ["Target velocity", "Controlword"]"#,
        ),
        (
            r#"map = ["Velocity actual value", "Torque actual value"]"#,
            r#"map = ["Velocity actual value"]"#,
        ),
    ] {
        assert_eq!(refused(from, to), "");
    }
}

#[test]
fn more_axes_than_it_leads() {
    let node = |n: u32| format!("\n[[node]]\nid = {n}\nname = \"axis {n}\"\ndevice = \"epos4\"\n");
    let more: String = (7..=17).map(node).collect();
    let text = sample()
        .replace("cycle_us = 10_000", "cycle_us = 20_000")
        .replace("tpdo_deadline_us = 5_000", "tpdo_deadline_us = 9_000")
        .replace("compute_us = 200", "compute_us = 340");
    let words = words(&format!("{text}{more}"));
    assert!(
        words.contains("`17`") && words.contains("at most 16 axes"),
        "{words}"
    );
}

#[test]
fn controlword_and_target_go_in_every_cycle() {
    says(
        "map = [\"Controlword\", \"Target velocity\"]",
        "send = \"on change\"\nmap = [\"Controlword\", \"Target velocity\"]",
        &["`RPDO1`", "controlword and target in every cycle"],
    );
}
