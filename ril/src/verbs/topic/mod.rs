//! `ril topic`, and its short forms `ril echo`, `hz`, `delay` and `bw`: topics of structs that this program was not
//! built with too.
//!
//! Here topics are listed and described. `echo` prints samples, `measure` feeds a [`meter`]; `stream` is how both of
//! them get samples.

pub mod echo;
pub mod generate;
pub mod histogram;
pub mod measure;
pub mod meter;
pub(crate) mod stream;

use std::fmt::Write as _;
use std::io::{self, Write};

use clap::{Args, Subcommand};
use ipc_types::Schema;
use ipc_types::dynamic::{self, ServiceFacts};
use ipc_types::schema::{Field, Kind, Message};
use operator::options::EXIT_CODES;
use operator::render::fields::Selection;
use operator::render::{json_line, note, print_as};
use operator::session::{Session, configuration, other_domains, others_alive};
use runtime::args::CommonArgs;
use runtime::exit::Failure;
use serde::Serialize;

use self::echo::EchoArgs;
use self::generate::TopicGenerateArgs;
use self::measure::MeasureArgs;
use self::meter::Quantity;
use self::stream::{schema_of, topic_key};

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
    Echo(EchoArgs),
    /// Measure how often samples of a topic come and how often they are published, and count the lost ones
    Hz(MeasureArgs),
    /// Measure how old samples of a topic are when they come
    Delay(MeasureArgs),
    /// Measure how many bytes the samples of a topic make
    Bw(MeasureArgs),
    /// Make a message definition a struct for Rust, for C and C++, and for Python
    Generate(TopicGenerateArgs),
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

/// `ril topic …`
///
/// # Errors
///
/// Code 3 when there is no such topic; see the commands.
pub fn topic(command: &TopicCommand) -> Result<(), Failure> {
    match command {
        TopicCommand::List(args) => list(args),
        TopicCommand::Info(args) => info(args),
        TopicCommand::Echo(args) => echo::echo(args),
        TopicCommand::Hz(args) => measure::measure(Quantity::Rate, args),
        TopicCommand::Delay(args) => measure::measure(Quantity::Age, args),
        TopicCommand::Bw(args) => measure::measure(Quantity::Bandwidth, args),
        TopicCommand::Generate(args) => generate::generate(args),
    }
}

/// A topic as one JSON object.
#[derive(Serialize)]
struct TopicObject<'a> {
    schema: &'static str,
    robot: u32,
    key: &'a str,
    #[serde(rename = "type")]
    type_name: &'a str,
    bytes: usize,
    layout_hash: String,
    /// Whether its publisher lives.
    live: bool,
}

fn list(args: &TopicListArgs) -> Result<(), Failure> {
    configuration(&args.common)?;
    let session = Session::join(&args.common)?;
    let topics = dynamic::topics(&session.ipc);
    let mut out = io::stdout().lock();
    if topics.is_empty() {
        let robot = session.ipc.robot();
        note(format_args!(
            "note: robot {robot} has no topic{}{}",
            others_alive(robot),
            other_domains()
        ));
    }
    if !args.json {
        return out
            .write_all(table(&topics).as_bytes())
            .map_err(Failure::output);
    }
    for topic in &topics {
        let object = TopicObject {
            schema: "ril.Topic.v1",
            robot: session.ipc.robot().get(),
            key: &topic.key,
            type_name: topic.schema.type_name(),
            bytes: topic.schema.size(),
            layout_hash: format!("{:016x}", topic.schema.layout_hash()),
            live: topic.provider.is_some(),
        };
        json_line(&mut out, &object)?;
    }
    Ok(())
}

/// A line for each topic.
fn table(topics: &[ServiceFacts]) -> String {
    let width = |column: fn(&ServiceFacts) -> &str| {
        let widths = topics.iter().map(|topic| column(topic).len());
        widths.max().unwrap_or_default()
    };
    let (key, type_name) = (
        width(|topic| &topic.key),
        width(|topic| topic.schema.type_name()),
    );
    let mut text = String::new();
    for topic in topics {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:key$}  {:type_name$}  {:>6} B{}",
            topic.key,
            topic.schema.type_name(),
            topic.schema.size(),
            match topic.provider {
                Some(_) => "",
                None => "  stale: its publisher was killed",
            }
        );
    }
    text
}

/// What a topic holds, as one JSON object.
#[derive(Serialize)]
struct InfoObject<'a> {
    schema: &'static str,
    robot: u32,
    key: &'a str,
    #[serde(rename = "type")]
    type_name: &'a str,
    ros_type: String,
    bytes: usize,
    alignment: usize,
    layout_hash: String,
    comment: &'a str,
    open: bool,
    fields: Vec<FieldObject>,
}

#[derive(Serialize)]
struct FieldObject {
    name: String,
    offset: usize,
    bytes: usize,
    #[serde(rename = "type")]
    kind: String,
    unit: Option<String>,
    comment: String,
}

fn info(args: &TopicInfoArgs) -> Result<(), Failure> {
    configuration(&args.common)?;
    let session = Session::join(&args.common)?;
    let (key, schema) = (&args.topic, &schema_of(&session, &args.topic)?);
    let selection = Selection::of_topic(schema, &args.fields, key)?;
    let topics = dynamic::topics(&session.ipc);
    let is_open = topics.iter().any(|topic| topic.key == *key);
    let object = InfoObject {
        schema: "ril.TopicInfo.v1",
        robot: session.ipc.robot().get(),
        key,
        type_name: schema.type_name(),
        ros_type: schema.ros_resource_name(),
        bytes: schema.size(),
        alignment: schema.align(),
        layout_hash: format!("{:016x}", schema.layout_hash()),
        comment: &schema.root().comment,
        open: is_open,
        fields: fields(schema, &selection),
    };
    print_as(
        args.json,
        &object,
        describe(key, schema, &selection, is_open),
    )
}

/// What a topic holds, for people.
fn describe(key: &str, schema: &Schema, selection: &Selection, is_open: bool) -> String {
    let mut text = format!(
        "topic   {key}{}\ntype    {} ({} in ROS 2)\nsize    {} B, alignment {}\nlayout  {:016x}\n\n",
        if is_open {
            ""
        } else {
            ", which no process has open"
        },
        schema.type_name(),
        schema.ros_resource_name(),
        schema.size(),
        schema.align(),
        schema.layout_hash(),
    );
    let fields = fields(schema, selection);
    let width = |column: fn(&FieldObject) -> usize| fields.iter().map(column).max().unwrap_or(0);
    let (name, kind) = (
        width(|field| field.name.len()),
        width(|field| field.kind.len()),
    );
    for field in &fields {
        let comment = field.comment.replace('\n', " ");
        let line = format!(
            "{:>6}  {:kind$}  {:name$}  {comment}",
            field.offset, field.kind, field.name
        );
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

/// The chosen fields by their full names, each struct before what lies in it. Of an array of structs the first element
/// stands for all.
fn fields(schema: &Schema, selection: &Selection) -> Vec<FieldObject> {
    let mut all = Vec::new();
    collect(schema.root(), "", 0, &mut all);
    all.retain(|field| selection.is_about(&field.name));
    all
}

fn collect(message: &Message, outer: &str, offset: usize, all: &mut Vec<FieldObject>) {
    for field in &message.fields {
        let name = format!("{outer}{}", field.name);
        let offset = offset + field.offset;
        all.push(object(field, &name, offset));
        if let Kind::Struct(nested) = &field.kind {
            let index = if field.len.is_some() { "[0]" } else { "" };
            collect(nested, &format!("{name}{index}."), offset, all);
        }
    }
}

fn object(field: &Field, name: &str, offset: usize) -> FieldObject {
    FieldObject {
        name: name.to_owned(),
        offset,
        bytes: field.size,
        kind: field.type_text(),
        unit: field.unit().map(str::to_owned),
        comment: field.comment.clone(),
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::Provider;
    use ipc_types::payload::ModuleState;

    use super::*;

    #[test]
    fn a_description_has_each_field_with_its_place_type_and_comment() {
        let text = describe(
            "module_state",
            &Schema::of::<ModuleState>(),
            &Selection::default(),
            false,
        );
        for line in [
            "topic   module_state, which no process has open",
            "type    hero.ModuleState.v7 (hero_msgs/msg/ModuleState in ROS 2)",
            "size    528 B, alignment 8",
            "    48  hero_msgs/MovementState",
            "Horizontal distance to the last waypoint, m; meaningful when `distance_valid` is 1. [m]",
            "uint32[26]",
        ] {
            assert!(text.contains(line), "{line}\n{text}");
        }
    }

    #[test]
    fn of_an_array_of_structs_the_first_stands_for_all() {
        let schema = "# Layout: a.A.v1\n\nuint64 sequence\na_msgs/B[2] cells\n\
            ================================================================================\n\
            MSG: a_msgs/B\n# Under load. [V]\nfloat32 level\n";
        let fields = fields(&Schema::parse(schema).unwrap(), &Selection::default());
        let names: Vec<_> = fields
            .iter()
            .map(|field| (field.name.as_str(), field.offset))
            .collect();
        assert_eq!(
            names,
            [("sequence", 0), ("cells", 8), ("cells[0].level", 8)]
        );
        assert_eq!(fields[2].unit.as_deref(), Some("V"));
    }

    #[test]
    fn the_list_is_aligned() {
        let provider = |is_alive: bool| {
            is_alive.then(|| Provider {
                pid: 1,
                process: "x".to_owned(),
                since_ns: 1,
                pid_namespace: 0,
                time_namespace: 0,
            })
        };
        let topic = |key: &str, name: &str, is_alive: bool| ServiceFacts {
            key: key.to_owned(),
            schema: Schema::parse(&format!("# Layout: x.{name}.v1\n\nuint64 sequence\n")).unwrap(),
            text: String::new(),
            provider: provider(is_alive),
        };
        let topics = [
            topic("a", "Long", true),
            topic("battery_watch/b", "B", false),
        ];
        assert_eq!(
            table(&topics),
            "a                x.Long.v1       8 B\n\
             battery_watch/b  x.B.v1          8 B  stale: its publisher was killed\n"
        );
        assert_eq!(table(&[]), "");
    }
}
