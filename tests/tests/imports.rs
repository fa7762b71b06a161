//! No circles of imports: of two files of a crate, at most one needs the other, directly or through others. So each file can be
//! read with what it imports, and nothing else.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Folders of the crates.
const CRATES: [&str; 12] = [
    "bench",
    "bindings/c",
    "bridge",
    "dsp-protocol",
    "dsp-sim",
    "ipc-types",
    "module-kit",
    "plans",
    "ril",
    "runtime",
    "status",
    "tests",
];

/// A file by the path of its module, such as `link::commands`.
type Module = String;

/// What each file imports of its own crate.
type Imports = BTreeMap<Module, BTreeSet<Module>>;

/// The modules of the files below `folder`, without tests, each with its source.
fn modules(folder: &Path, path: &[String]) -> BTreeMap<Module, String> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).expect("a folder that can be read") {
        let file = entry.expect("an entry").path();
        let name = file.file_stem().and_then(|name| name.to_str());
        let name = name.expect("a name of a module").to_owned();
        if name == "tests" {
            continue;
        }
        let mut path = path.to_vec();
        if file.is_dir() {
            path.push(name);
            found.extend(modules(&file, &path));
            continue;
        }
        let is_root = path.is_empty() && ["lib", "main"].contains(&name.as_str());
        if file.extension().is_none_or(|extension| extension != "rs") || is_root {
            continue;
        }
        if name != "mod" {
            path.push(name);
        }
        let source = fs::read_to_string(&file).expect("a source that can be read");
        found.insert(path.join("::"), source);
    }
    found
}

/// The paths below `crate::` that a source imports, outside its tests.
fn imported(source: &str) -> Vec<String> {
    let source = source.split("#[cfg(test)]\nmod tests {").next();
    let mut paths = Vec::new();
    for statement in source.unwrap_or_default().split(';') {
        // An import begins a line; what is before it ended without a semicolon.
        let lines = statement.lines().map(str::trim_start);
        let begin = lines.clone().position(|line| {
            let line = line
                .trim_start_matches("pub(crate) ")
                .trim_start_matches("pub ");
            line.starts_with("use crate::")
        });
        let Some(begin) = begin else { continue };
        let text: String = lines.skip(begin).collect();
        if let Some((_, tree)) = text.split_once("use crate::") {
            flatten("", tree, &mut paths);
        }
    }
    paths
}

/// The paths of a tree such as `a::{b, c::{d, e}}`.
fn flatten(prefix: &str, tree: &str, paths: &mut Vec<String>) {
    let (head, inner) = match tree.split_once('{') {
        None => return paths.push(format!("{prefix}{}", tree.trim())),
        Some((head, inner)) => (head, inner.strip_suffix('}').unwrap_or(inner)),
    };
    let prefix = format!("{prefix}{}", head.trim());
    let (mut depth, mut begin) = (0, 0);
    for (index, letter) in inner.char_indices().chain([(inner.len(), ',')]) {
        match letter {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                let part = inner[begin..index].trim();
                if !part.is_empty() {
                    flatten(&prefix, part, paths);
                }
                begin = index + 1;
            }
            _ => {}
        }
    }
}

fn imports(modules: &BTreeMap<Module, String>) -> Imports {
    let file_of = |path: &str| {
        let mut path = path;
        loop {
            if modules.contains_key(path) {
                return Some(path.to_owned());
            }
            path = path.rsplit_once("::")?.0;
        }
    };
    modules
        .iter()
        .map(|(module, source)| {
            let files = imported(source)
                .into_iter()
                .filter_map(|path| file_of(&path));
            (
                module.clone(),
                files.filter(|file| file != module).collect(),
            )
        })
        .collect()
}

/// The files that lie on a circle: what is left when those that import nothing which is left are taken away, again and again.
fn on_circles(mut imports: Imports) -> Vec<String> {
    loop {
        let done: Vec<_> = imports
            .iter()
            .filter(|(_, needs)| needs.iter().all(|need| !imports.contains_key(need)))
            .map(|(module, _)| module.clone())
            .collect();
        if done.is_empty() {
            break;
        }
        done.iter().for_each(|module| _ = imports.remove(module));
    }
    let left: BTreeSet<_> = imports.keys().cloned().collect();
    imports
        .iter()
        .map(|(module, needs)| format!("{module} imports {:?}", needs & &left))
        .collect()
}

#[test]
fn no_files_of_a_crate_import_in_circles() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for name in CRATES {
        let modules = modules(&root.join(name).join("src"), &[]);
        assert!(!modules.is_empty(), "no sources in {name}");
        let found = on_circles(imports(&modules));
        assert!(
            found.is_empty(),
            "{name}: files that lie on a circle, or import such files:\n{}",
            found.join("\n")
        );
    }
}

#[test]
fn a_circle_through_three_files_is_found() {
    let sources = [
        (
            "a",
            "//! use crate::d;\nuse std::fs;\nuse crate::b::{Bee, Hive};",
        ),
        (
            "b",
            "fn f() {}\npub(crate) use crate::{\n    d::Dee,\n    c::inner::{See, Saw},\n};",
        ),
        ("c::inner", "use crate::a::Ay;"),
        ("d", "#[cfg(test)]\nmod tests {\n    use crate::a::Ay;\n}"),
    ];
    let modules = sources.map(|(module, source)| (module.to_owned(), source.to_owned()));
    let found = on_circles(imports(&BTreeMap::from(modules)));
    let expected = [
        r#"a imports {"b"}"#,
        r#"b imports {"c::inner"}"#,
        r#"c::inner imports {"a"}"#,
    ];
    assert_eq!(found, expected);
}
