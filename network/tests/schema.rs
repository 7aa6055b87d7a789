//! The schema for editors and the reference name the keys that there are.

use std::collections::BTreeSet;
use std::path::Path;

use canmaster_network::{Source, read};
use serde_json::Value;

/// What no key is called.
const NO_KEY: &str = "no_such_key";

fn docs(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../docs")
        .join(name);
    std::fs::read_to_string(path).unwrap()
}

/// A description with a wrong key in one table, the table's place in the schema
/// and its heading in the reference.
fn tables() -> Vec<(&'static str, String, &'static str, &'static str)> {
    let device = "[device.x]\neds=\"x\"\nheartbeat_ms=1\nmaster_timeout_ms=1\n";
    let master = "[master]\nnode_id=1\nheartbeat_ms=1\nsilence_ms=1\nboot_time_ms=1\n\
        sdo_tries=1\nsyncs_before_start=1\n";
    let bad = format!("{NO_KEY}=1\n");
    vec![
        ("whole", bad.clone(), "", ""),
        (
            "master",
            format!("[master]\n{bad}"),
            "/properties/master",
            "[master]",
        ),
        (
            "bus",
            format!("{master}[bus.x]\n{bad}"),
            "/$defs/bus",
            "[bus.NAME]",
        ),
        (
            "liveness",
            format!("{master}[bus]\n[liveness]\n{bad}"),
            "/properties/liveness",
            "[liveness]",
        ),
        (
            "device",
            format!("{master}[bus]\n[device.x]\n{bad}"),
            "/$defs/device",
            "[device.NAME]",
        ),
        (
            "pdo",
            format!("{master}[bus]\n{device}[device.x.rpdo.1]\n{bad}"),
            "/$defs/pdo",
            "rpdo.N",
        ),
        (
            "axis",
            format!("{master}[bus]\n{device}[device.x.axis]\n{bad}"),
            "/$defs/axis",
            ".axis]",
        ),
        (
            "group",
            format!("{master}[group]\n{bad}"),
            "/properties/group",
            "[group]",
        ),
        (
            "start value",
            format!("{master}[bus]\n{device}[[device.x.start_values]]\n{bad}"),
            "/$defs/start_value",
            "start_values\n\n",
        ),
        (
            "node",
            format!("{master}[bus]\n[device]\n[[node]]\n{bad}"),
            "/$defs/node",
            "[[node]]",
        ),
    ]
}

/// The keys that the reader would have taken.
fn known(toml: &str) -> BTreeSet<String> {
    let outcome = read(&Source::new("network.toml", toml.as_bytes()), &mut |_| {
        Err(std::io::ErrorKind::NotFound.into())
    });
    let rule = &outcome.problems[0].rule;
    assert!(rule.starts_with("unknown field"), "{toml}: {rule}");
    let names = rule.split('`').skip(1).step_by(2);
    names
        .filter(|name| *name != NO_KEY)
        .map(String::from)
        .collect()
}

#[test]
fn the_schema_has_the_keys_that_there_are() {
    let schema: Value = serde_json::from_str(&docs("network.schema.json")).unwrap();
    for (name, toml, place, _) in tables() {
        let table = schema.pointer(place).unwrap_or_else(|| panic!("{place}"));
        let properties = table["properties"].as_object().unwrap();
        let keys: BTreeSet<String> = properties.keys().cloned().collect();
        assert_eq!(keys, known(&toml), "{name}");
        assert_eq!(table["additionalProperties"], Value::Bool(false), "{name}");
        for (key, property) in properties {
            let described = property.get("description").or(property.get("$ref"));
            assert!(described.is_some(), "{name}: {key} has no description");
        }
    }
}

#[test]
fn the_reference_explains_every_key() {
    let reference = docs("network.md");
    for (name, toml, _, heading) in tables() {
        let section = reference
            .split("\n## ")
            .find(|section| {
                section
                    .lines()
                    .next()
                    .is_some_and(|line| line.contains(heading.trim_end()))
            })
            .unwrap();
        for key in known(&toml) {
            assert!(section.contains(&format!("`{key}`")), "{name}: {key}");
        }
    }
}
