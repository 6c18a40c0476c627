//! The configuration as a user writes it.
// A test writes the file that it reads.
#![allow(clippy::disallowed_methods)]

use super::*;
use clap::Parser;

fn load(name: &str, toml: &str, flags: &[&str]) -> Result<Config, String> {
    let path = std::env::temp_dir().join(format!("fleet-config-{}-{name}.toml", std::process::id()));
    std::fs::write(&path, toml).unwrap();
    let shown = path.display().to_string();
    let arguments = ["fleet-agent", "--config", &shown].into_iter().chain(flags.iter().copied());
    let result = Config::load(&Cli::try_parse_from(arguments).unwrap());
    std::fs::remove_file(&path).unwrap();
    result.map_err(|error| error.to_string().replace(&shown, "FILE"))
}

#[test]
fn flags_win_over_the_file_and_the_file_over_defaults() {
    let toml = "drone = \"d1\"\nsystem = 3\nmavlink = \"udpin:127.0.0.1:1\"\n[landing]\ndescent = 0.5\n";
    let config = load("win", toml, &["--system", "9"]).unwrap();
    assert_eq!(
        (config.link.system, config.agent.drone.as_str(), config.agent.fleet.as_str()),
        (9, "d1", "fleet")
    );
    assert_eq!(config.link.mavlink.to_string(), "udpin:127.0.0.1:1");
    assert_eq!(config.agent.landing.descent, 0.5);
    assert_eq!(config.agent.gains, AgentConfig::new("f", "d").gains);
}

#[test]
fn printed_configuration_reads_back_the_same() {
    let toml = "drone = \"d1\"\nrecord = \"x.mcap\"\nzenoh = [\"tcp/[::1]:7\"]\n[vehicle]\nv_max = 2.0\n";
    let config = load("print", toml, &[]).unwrap();
    assert_eq!(load("again", &config.to_toml().unwrap(), &[]).unwrap(), config);
}

#[test]
fn errors_name_file_field_value_and_what_is_legal() {
    let cases = [
        ("", "FILE: drone: missing; give --drone ID"),
        ("drone = \"d 1\"", "FILE: drone: \"d 1\" is not a name; legal is a letter"),
        ("drone = 5", "FILE: drone: 5 is not a string"),
        ("drone = \"d1\"\nsytem = 1", "FILE: sytem: unknown field; legal are: zenoh, mavlink, system"),
        ("drone = \"d1\"\nsystem = 0", "FILE: system: 0 is not a MAVLink system id; legal are 1 to 255"),
        ("drone = \"d1\"\nsystem = 300", "FILE: system: 300: invalid value"),
        (
            "drone = \"d1\"\nmavlink = \"udp:1\"",
            "FILE: mavlink: \"udp:1\": \"udp:1\" is not a MAVLink endpoint; legal is udpin:",
        ),
        ("drone = \"d1\"\nmavlink = \"udpout:127.0.0.1:0\"", "FILE: mavlink: "),
        ("drone = \"d1\"\nzenoh = []", "FILE: zenoh: no endpoint"),
        (
            "drone = \"d1\"\nzenoh = [\"127.0.0.1\"]",
            "FILE: zenoh: \"127.0.0.1\" is not a Zenoh endpoint; legal is tcp/",
        ),
        ("drone = \"d1\"\nlanding = 3", "FILE: landing: 3 is not a table; legal is [landing]"),
        ("drone = \"d1\"\n[landing]\ndescent = \"slow\"", "FILE: landing.descent: \"slow\": invalid type"),
        ("drone = \"d1\"\n[landing]\nspeed = 1.0", "FILE: landing.speed: 1.0: unknown field"),
        ("drone = \"d1\"\nsystem = = 1", "FILE: line 2: "),
    ];
    for (index, (toml, expected)) in cases.iter().enumerate() {
        let error = load(&format!("error{index}"), toml, &[]).unwrap_err();
        assert!(error.starts_with(expected), "{toml:?} gave {error:?}, not {expected:?}");
        assert!(!error.contains('\n'), "{error:?}");
    }
}

#[test]
fn a_wrong_flag_is_not_blamed_on_the_file() {
    let error = load("flag", "drone = \"d1\"", &["--fleet", "a/b"]).unwrap_err();
    assert!(error.starts_with("command line: fleet: \"a/b\" is not a name"), "{error}");
}

#[test]
fn only_loopback_without_insecure() {
    let cases = [
        "zenoh = [\"tcp/10.0.0.1:7447\"]",
        "zenoh = [\"tcp/example.org:1\"]",
        "mavlink = \"udpin:0.0.0.0:14540\"",
    ];
    for (index, case) in cases.iter().enumerate() {
        let toml = format!("drone = \"d1\"\n{case}");
        let error = load(&format!("loop{index}"), &toml, &[]).unwrap_err();
        assert!(error.contains("only 127.0.0.1, ::1 and localhost are legal without --insecure"), "{error}");
        assert!(load(&format!("insecure{index}"), &toml, &["--insecure"]).is_ok());
    }
    assert!(load("local", "drone = \"d1\"\nzenoh = [\"tcp/localhost:1\", \"tcp/[::1]:2\"]", &[]).is_ok());
}

#[test]
fn a_missing_file_is_named() {
    let cli = Cli::try_parse_from(["fleet-agent", "--config", "/nonexistent.toml"]).unwrap();
    let error = Config::load(&cli).unwrap_err().to_string();
    assert!(error.starts_with("/nonexistent.toml: file: cannot be read"), "{error}");
}
