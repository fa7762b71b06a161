//! The arguments of commands that print and measure topics.

use std::time::Duration;

use clap::{Args, Subcommand, ValueEnum};
use ipc_types::ServiceId;
use ipc_types::service::is_key;
use runtime::args::CommonArgs;

use crate::options::EXIT_CODES;
use crate::options::duration;

/// `ril echo`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct EchoArgs {
    /// Which samples
    #[arg(value_enum)]
    pub topic: Topic,

    /// What every command takes that prints samples.
    #[command(flatten)]
    pub options: EchoOptions,
}

/// What every command takes that prints samples.
#[derive(Args, Clone, Debug)]
pub struct EchoOptions {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// End after so many samples
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub count: Option<u64>,

    /// End after this time, such as 10s
    #[arg(long, value_name = "DURATION", value_parser = duration)]
    pub duration: Option<Duration>,

    /// How long to wait for the first sample, and for a publisher that is gone, such as 5s or 200ms [default: 2s, or ril.toml]
    #[arg(long, value_name = "DURATION", env = "RIL_TIMEOUT", value_parser = duration)]
    pub timeout: Option<Duration>,

    /// Print only this field, or group of fields, such as geographic.latitude_deg or geographic; can be repeated. `ril topic info`
    /// lists them
    #[arg(long = "field", value_name = "NAME")]
    pub fields: Vec<String>,

    /// Print each sample as a JSON object on a line
    #[arg(long)]
    pub json: bool,
}

/// `ril topic`
#[derive(Args, Clone, Debug)]
pub struct TopicArgs {
    /// What to do with the topics.
    #[command(subcommand)]
    pub command: TopicCommand,
}

/// `ril topic …`
#[derive(Clone, Debug, Subcommand)]
pub enum TopicCommand {
    /// List the open topics, with their types and sizes
    List(TopicListArgs),
    /// Describe a topic: its type, and each field with offset, type, unit and comment
    Info(TopicInfoArgs),
    /// Print samples of a topic as they come
    Echo(TopicEchoArgs),
    /// Measure how often samples of a topic come and how often they are published, and count the lost ones
    Hz(TopicMeasureArgs),
    /// Measure how old samples of a topic are when they come
    Delay(TopicMeasureArgs),
    /// Measure how many bytes the samples of a topic make
    Bw(TopicMeasureArgs),
}

/// `ril topic list`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct TopicListArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Print each topic as a JSON object on a line
    #[arg(long)]
    pub json: bool,
}

/// `ril topic info`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct TopicInfoArgs {
    /// Topic, as `ril topic list` shows it, such as battery_watch/cell_voltages; or dsp, hero, state
    #[arg(value_name = "TOPIC", value_parser = topic_key)]
    pub topic: String,

    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Describe only this field, or group of fields, such as geographic.latitude_deg or geographic; can be repeated
    #[arg(long = "field", value_name = "NAME")]
    pub fields: Vec<String>,

    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

/// `ril topic echo`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct TopicEchoArgs {
    /// Topic, as `ril topic list` shows it, such as battery_watch/cell_voltages; or dsp, hero, state
    #[arg(value_name = "TOPIC", value_parser = topic_key)]
    pub topic: String,

    /// What every command takes that prints samples.
    #[command(flatten)]
    pub options: EchoOptions,
}

/// `ril topic hz`, `ril topic delay`, `ril topic bw`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct TopicMeasureArgs {
    /// Topic, as `ril topic list` shows it, such as battery_watch/cell_voltages; or dsp, hero, state
    #[arg(value_name = "TOPIC", value_parser = topic_key)]
    pub topic: String,

    /// What every command takes that measures samples.
    #[command(flatten)]
    pub options: MeasureOptions,
}

/// `ril hz`, `ril delay`, `ril bw`
///
/// On a terminal the figures are shown anew each second; elsewhere once, at the end.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct MeasureArgs {
    /// Which samples
    #[arg(value_enum)]
    pub topic: Topic,

    /// What every command takes that measures samples.
    #[command(flatten)]
    pub options: MeasureOptions,
}

/// What every command takes that measures samples.
#[derive(Args, Clone, Debug)]
#[group(id = "end", multiple = true, args = ["count", "duration"])]
pub struct MeasureOptions {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// End after so many samples, of which a rate needs two
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..))]
    pub count: Option<u64>,

    /// End after this time, such as 10s
    #[arg(long, value_name = "DURATION", value_parser = duration)]
    pub duration: Option<Duration>,

    /// How long to wait for the first sample, and for a publisher that is gone, such as 5s or 200ms [default: 2s, or ril.toml]
    #[arg(long, value_name = "DURATION", env = "RIL_TIMEOUT", value_parser = duration)]
    pub timeout: Option<Duration>,

    /// Show the histograms too, which takes more than 24 lines; JSON always has them
    #[arg(long)]
    pub histogram: bool,

    /// Print one JSON object at the end; needs --count, --duration or both
    #[arg(long, requires = "end")]
    pub json: bool,
}

/// What can be watched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Topic {
    /// Telemetry as the DSP sends it
    Dsp,
    /// Telemetry in SI units
    Hero,
    /// State of the module
    State,
}

impl Topic {
    /// Key of the service.
    pub fn key(self) -> &'static str {
        let service = match self {
            Topic::Dsp => ServiceId::DspTelemetry,
            Topic::Hero => ServiceId::HeroTelemetry,
            Topic::State => ServiceId::ModuleState,
        };
        service.key()
    }
}

/// Reads the key of a topic; the short names of the robot's own stand for theirs.
fn topic_key(text: &str) -> Result<String, String> {
    let short = Topic::value_variants().iter().find(|topic| {
        let value = topic.to_possible_value();
        value.is_some_and(|value| value.get_name() == text)
    });
    match short {
        Some(topic) => Ok(topic.key().to_owned()),
        None if is_key(text) => Ok(text.to_owned()),
        None => Err("a topic is called such as battery_watch/cell_voltages".to_owned()),
    }
}
