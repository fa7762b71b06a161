//! The header says what the functions are: each prototype of `hero_ril.h` is compared with the Rust signature.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Types of the C ABI as the header writes them.
const TYPES: [(&str, &str); 34] = [
    ("*const c_char", "const char *"),
    ("*const c_void", "const void *"),
    ("*mut c_void", "void *"),
    ("*mut *mut Robot", "hero_ril_robot **"),
    ("*mut Robot", "hero_ril_robot *"),
    ("*mut *mut DynamicSubscriber", "hero_ril_subscriber **"),
    ("*mut DynamicSubscriber", "hero_ril_subscriber *"),
    ("*const DynamicSubscriber", "const hero_ril_subscriber *"),
    ("*mut *mut DynamicPublisher", "hero_ril_publisher **"),
    ("*mut DynamicPublisher", "hero_ril_publisher *"),
    ("*mut *mut Requests", "hero_ril_client **"),
    ("*mut Requests", "hero_ril_client *"),
    ("*mut *mut Serving", "hero_ril_server **"),
    ("*mut Serving", "hero_ril_server *"),
    ("*mut *mut OwnModule", "hero_ril_module **"),
    ("*mut OwnModule", "hero_ril_module *"),
    ("*const Topic", "const hero_ril_topic *"),
    ("*const Service", "const hero_ril_service *"),
    ("*const Waypoint", "const hero_ril_waypoint *"),
    ("*mut Waypoint", "hero_ril_waypoint *"),
    ("*const Offset", "const hero_ril_offset *"),
    ("*mut Offset", "hero_ril_offset *"),
    ("*const HeroTelemetry", "const HeroTelemetry *"),
    ("*const AnySource", "const hero_ril_source *"),
    ("*mut LossCounts", "hero_ril_losses *"),
    ("*mut RequestReport", "RequestReport *"),
    ("*const RequestReport", "const RequestReport *"),
    ("SampleCallback", "hero_ril_sample_callback"),
    ("*mut c_int", "int *"),
    ("*mut u64", "uint64_t *"),
    ("*mut usize", "size_t *"),
    ("c_int", "int"),
    ("usize", "size_t"),
    ("f64", "double"),
];

fn c_type(rust: &str) -> &str {
    match rust {
        "u32" => "uint32_t",
        "u64" => "uint64_t",
        "i32" => "int32_t",
        "" => "void",
        _ => {
            let found = TYPES.iter().find(|(name, _)| *name == rust);
            found.unwrap_or_else(|| panic!("no C type for `{rust}`")).1
        }
    }
}

fn read(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

fn words(text: &str) -> String {
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    text.replace("* ", "*").replace("( ", "(")
}

/// By name: the prototype, with single spaces.
fn of_rust() -> BTreeMap<String, String> {
    let files = [
        "mod", "robot", "topics", "requests", "serving", "module", "waiting", "places",
    ];
    let source: String = files
        .iter()
        .map(|file| read(&format!("src/capi/{file}.rs")))
        .collect();
    let functions = source.split("extern \"C\" fn hero_ril_").skip(1);
    functions
        .map(|rest| {
            let (name, rest) = rest.split_once('(').unwrap();
            let (arguments, rest) = rest.split_once(')').unwrap();
            let head = rest.split(['{', ';']).next().unwrap();
            let result = head.trim().strip_prefix("-> ").unwrap_or_default().trim();
            let arguments: Vec<_> = arguments
                .split(',')
                .filter_map(|argument| argument.trim().split_once(':'))
                .map(|(name, kind)| format!("{} {name}", c_type(kind.trim())))
                .collect();
            let arguments = match arguments.is_empty() {
                true => "void".to_owned(),
                false => arguments.join(", "),
            };
            let name = format!("hero_ril_{name}");
            let prototype = format!("{} {name}({arguments})", c_type(result));
            (name, words(&prototype))
        })
        .filter(|(name, _)| name != "hero_ril_test_panic")
        .collect()
}

/// The header without comments and preprocessor lines.
fn code(header: &str) -> String {
    let without = header
        .split("/*")
        .map(|part| part.rsplit("*/").next().unwrap());
    let text: String = without.collect();
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    lines.collect::<Vec<_>>().join("\n")
}

fn of_header() -> BTreeMap<String, String> {
    let header = read("include/hero_ril.h");
    code(&header)
        .split([';', '}'])
        .map(words)
        // Not types, and not what is in braces.
        .filter(|text| text.ends_with(')') && !text.contains('{'))
        .filter(|text| !text.starts_with("typedef") && !text.starts_with("return"))
        .filter_map(|text| {
            let head = text.split('(').next()?;
            let name = head[head.rfind("hero_ril_")?..].to_owned();
            Some((name, text))
        })
        .collect()
}

#[test]
fn the_header_has_the_functions_as_they_are() {
    let (rust, header) = (of_rust(), of_header());
    assert!(rust.len() > 32, "{rust:#?}");
    for (name, prototype) in &rust {
        assert_eq!(header.get(name), Some(prototype), "{name}");
    }
    let extra: Vec<_> = header
        .keys()
        .filter(|name| !rust.contains_key(*name))
        .collect();
    assert!(extra.is_empty(), "{extra:?}");
}
