use super::case::Limits;
use super::*;

#[test]
fn every_scenario_has_its_description() {
    for case in &CASES {
        assert!(case.path().is_file(), "{}", case.path().display());
    }
}

#[test]
fn only_three_buses_may_take_longer_for_the_last_request() {
    for case in CASES.iter().chain([&SEARCHED]) {
        let Limits {
            first_request_cycles,
            last_request_cycles,
            ..
        } = case.limits;
        let last = match case.name {
            "three_bus_1ms_full" => 260,
            _ => 170,
        };
        assert_eq!(
            (first_request_cycles, last_request_cycles),
            (170, last),
            "{}",
            case.name
        );
    }
}
