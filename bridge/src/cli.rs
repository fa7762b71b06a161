//! The command line of the bridge process.

use std::path::Path;

use clap::Args as ClapArgs;
use ipc_types::configuration::ConfigurationText;
use module_kit::SetUp;
use runtime::args::CommonArgs;
use runtime::config::resulting::{Resulting, given, value_of};
use runtime::exit::{ExitCode, Failure};

use crate::config::BridgeConfig;
use crate::shell::{self, FenceOfFile, PortError, ShellError};

/// The configuration file that is read when none is named; it may be absent.
pub const DEFAULT_CONFIG_FILE: &str = "bridge.toml";

/// The annotated configuration, with every default.
const EXAMPLE: &str = include_str!("../bridge.toml");

/// Options of the bridge.
#[derive(ClapArgs, Clone, Debug)]
pub struct Args {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Serial port, instead of `serial.port` of the configuration
    #[arg(long, value_name = "PATH", env = "RIL_PORT")]
    pub port: Option<std::path::PathBuf>,
}

/// What the bridge would run with.
///
/// # Errors
///
/// Exit code 78 when the configuration is wrong.
pub fn check_config(args: &Args) -> Result<Resulting, Failure> {
    let (file, default) = (
        args.common.settings.config.as_deref(),
        Path::new(DEFAULT_CONFIG_FILE),
    );
    let loaded = runtime::config::load::<BridgeConfig>(file, default)?;
    let fits = loaded.value.check_line();
    fits.map_err(|fault| loaded.refuse(&fault))?;
    let resulting = Resulting::load::<BridgeConfig>(file, default, EXAMPLE)?;
    let port = given("--port", "RIL_PORT").filter(|_| args.port.is_some());
    let port = port.map(|(text, origin)| (value_of(&text), origin));
    Ok(resulting.with("serial.port", port))
}

/// The text of `bridge/configuration`.
fn text_of(config: &BridgeConfig, resulting: &Resulting) -> ConfigurationText {
    ConfigurationText::new(resulting.annotate(&config.to_toml()))
}

/// Runs the bridge in the foreground until SIGINT or SIGTERM.
///
/// # Errors
/// Exit code 78 when the configuration is wrong, 1 when shared memory cannot be used or another bridge of the robot
/// runs.
pub fn run(args: Args) -> Result<(), Failure> {
    if args.common.settings.check_config {
        return check_config(&args)?.print();
    }
    let check = |config: &mut BridgeConfig| {
        if let Some(port) = &args.port {
            config.serial.port.clone_from(port);
        }
        config.check_line()
    };
    let set_up = SetUp::begin_with(&args.common, DEFAULT_CONFIG_FILE, check)?;
    let Some(set_up) = set_up else {
        return Ok(());
    };
    let ipc = set_up.join("bridge")?;
    let explicit = args.common.settings.config.clone();
    let resulting = check_config(&args)?;
    let configuration = text_of(&set_up.config, &resulting);
    let config = set_up.config.clone();
    let read_fence = move || {
        let (file, default) = (explicit.as_deref(), Path::new(DEFAULT_CONFIG_FILE));
        let loaded = runtime::config::load::<BridgeConfig>(file, default);
        let fence = loaded.map_err(|error| error.to_string())?.value.fence;
        let of_file = Resulting::load::<BridgeConfig>(file, default, EXAMPLE);
        let of_file = of_file.map_err(|error| error.to_string())?;
        let running = BridgeConfig {
            fence: fence.clone(),
            ..config.clone()
        };
        let resulting = resulting.clone().with_table("fence", of_file);
        Ok(FenceOfFile {
            fence,
            configuration: text_of(&running, &resulting),
        })
    };
    shell::run(
        &set_up.config,
        configuration,
        read_fence,
        &ipc,
        &set_up.termination,
        &set_up.supervisor,
    )
    .map_err(|error| match error {
        ShellError::Port(PortError::NotAPort(_)) => Failure::new(ExitCode::Configuration, error),
        _ => Failure::internal(error),
    })
}

#[cfg(test)]
mod tests {
    use runtime::config::resulting::Origin;

    use super::*;

    #[test]
    fn the_text_that_is_published_is_the_configuration_with_the_origin_of_each_value() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("bridge.toml");
        let lines = "[safety]\nsupply_for_s = 3.5\n[fence]\nceiling_m = 50.0\n\
            [[fence.area]]\nname = \"d\u{e9}p\u{f4}t\"\nkind = \"exclusion\"\ncentre = [37.0, -6.0]\nradius_m = 5.0\n";
        std::fs::write(&file, lines).unwrap();
        let load = |example: &str| -> (BridgeConfig, Resulting) {
            let loaded = runtime::config::load(Some(&file), &file).unwrap();
            let resulting = Resulting::load::<BridgeConfig>(Some(&file), &file, example).unwrap();
            (loaded.value, resulting)
        };
        let (mut config, resulting) = load(EXAMPLE);
        config.serial.port = "/tmp/dsp".into();
        let port = given("--port", "").or(Some(("/tmp/dsp".into(), Origin::CommandLine("--port"))));
        let resulting = resulting.with("serial.port", port.map(|(text, at)| (value_of(&text), at)));
        let text = resulting.annotate(&config.to_toml());
        assert_eq!(
            runtime::config::parse::<BridgeConfig>(&text, "a test").unwrap(),
            config
        );
        let shown = |line: &str| {
            text.lines()
                .any(|shown| shown.split_whitespace().collect::<Vec<_>>().join(" ") == line)
        };
        let from = file.display();
        for line in [
            "port = \"/tmp/dsp\" # --port".to_owned(),
            "baud_rate = 115200 # built-in".to_owned(),
            format!("supply_for_s = 3.5 # {from}:2"),
            format!("radius_m = 5.0 # {from}:9"),
        ] {
            assert!(shown(&line), "{line}\n{text}");
        }
    }
}
