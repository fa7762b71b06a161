//! No circles of imports: of two files of a crate, at most one needs the other, directly or through others. So each
//! file can be read with what it names, and nothing else. A parent and its children are files as all others: what both
//! need has a file of its own.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Folders of the crates: the members of the workspace, and the benchmarks, which are a workspace of their own.
pub(super) fn crates() -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml");
    let manifest = fs::read_to_string(root).expect("the manifest of the workspace");
    let members = manifest.split_once("\nmembers = [").expect("members").1;
    let members = members.split_once(']').expect("an end of the members").0;
    let folders = members.split('"').skip(1).step_by(2).map(str::to_owned);
    folders.chain(["workbench/bench".to_owned()]).collect()
}

/// A file by the path of its module, such as `link::commands`.
type Module = String;

/// What each file names of its own crate.
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

/// What a source says outside its tests and comments.
pub(super) fn code(source: &str) -> String {
    let mut outside = String::new();
    let mut rest = source;
    while let Some((before, behind)) = rest.split_once("#[cfg(test)]\nmod ") {
        outside.push_str(before);
        let is_inline = behind
            .lines()
            .next()
            .is_some_and(|line| line.ends_with('{'));
        // As rustfmt writes it, a module ends with the first brace that begins a line.
        let end = is_inline.then(|| behind.find("\n}\n"));
        rest = end.map_or(behind, |end| end.map_or("", |end| &behind[end + 3..]));
    }
    outside.push_str(rest);
    let code: Vec<&str> = outside
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default())
        .collect();
    code.join("\n")
}

/// The modules that lie in files of their own below this one.
fn children(code: &str) -> BTreeSet<&str> {
    let lines = code.lines().map(str::trim);
    let declared = lines.filter_map(|line| line.strip_suffix(';')?.rsplit_once("mod "));
    let is_name = |name: &str| name.chars().all(is_of_word);
    declared
        .map(|(_, name)| name)
        .filter(|name| is_name(name))
        .collect()
}

pub(super) fn is_of_word(letter: char) -> bool {
    letter.is_ascii_alphanumeric() || letter == '_'
}

/// The paths that a file names of its own crate, in imports, in code and in attributes: from `crate`, from `super`, and
/// through its own children. `$crate` of a macro is the place where it is used.
fn named(code: &str) -> Vec<String> {
    let children = children(code);
    let mut paths = Vec::new();
    let mut rest = code;
    while let Some(at) = rest.find("::") {
        let (before, behind) = rest.split_at(at);
        let first = before.rsplit(|letter| !is_of_word(letter)).next();
        let first = first.unwrap_or_default();
        let is_path = ["crate", "super", "self"].contains(&first) || children.contains(first);
        let len = path_len(behind);
        if is_path && !before.ends_with(&format!("${first}")) {
            flatten(first, &behind[..len], &mut paths);
        }
        rest = &behind[len..];
    }
    paths
}

/// How long the rest of a path is that begins with `::`, with the tree in braces at its end.
fn path_len(rest: &str) -> usize {
    let mut depth = 0;
    let end = rest.char_indices().find(|(index, letter)| {
        match letter {
            '{' if depth > 0 || rest[..*index].ends_with("::") => depth += 1,
            '}' if depth > 0 => {
                depth -= 1;
                return false;
            }
            _ => {}
        }
        let is_of_path = is_of_word(*letter) || [':', '*'].contains(letter);
        depth == 0 && !is_of_path
    });
    let end = end.map_or(rest.len(), |(index, _)| index);
    end.max(2)
}

/// The module `path` of the file `module`, from the root of the crate; `None` if it is none but the file's parents, as
/// in `pub(in super::super)`.
fn from_root(module: &str, path: &str) -> Option<String> {
    let mut place: Vec<&str> = module.split("::").filter(|name| !name.is_empty()).collect();
    let mut names = path.split("::").peekable();
    match *names.peek()? {
        "crate" => {
            place.clear();
            names.next();
        }
        "self" => _ = names.next(),
        _ => {
            while names.next_if_eq(&"super").is_some() {
                place.pop()?;
            }
        }
    }
    names.peek()?;
    place.extend(names);
    Some(place.join("::"))
}

/// The paths of a tree such as `a::{b, c::{d, e}}`.
fn flatten(prefix: &str, tree: &str, paths: &mut Vec<String>) {
    let (head, inner) = match tree.split_once('{') {
        None => {
            let path = tree.split(" as ").next().unwrap_or_default();
            return paths.push(format!("{prefix}{}", path.trim()));
        }
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
            let paths = named(&code(source)).into_iter();
            let paths = paths.filter_map(|path| from_root(module, &path));
            let files = paths.filter_map(|path| file_of(&path));
            (
                module.clone(),
                files.filter(|file| file != module).collect(),
            )
        })
        .collect()
}

/// The files that lie on a circle: what is left when those that import nothing which is left are taken away, again and
/// again.
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
    let mut all = Vec::new();
    for name in crates() {
        let modules = modules(&root.join(&name).join("src"), &[]);
        assert!(!modules.is_empty(), "no sources in {name}");
        let found = on_circles(imports(&modules));
        all.extend(found.into_iter().map(|line| format!("{name}: {line}")));
    }
    let all = all.join("\n");
    assert!(
        all.is_empty(),
        "files that lie on a circle, or import such files:\n{all}"
    );
}

/// Folders import in no circle: of two siblings, files or folders, at most one needs the other. A parent may name its
/// children, and they it.
#[test]
fn no_folders_of_a_crate_import_in_circles() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut all = Vec::new();
    for name in crates() {
        let imports = imports(&modules(&root.join(&name).join("src"), &[]));
        for (folder, siblings) in siblings(&imports) {
            let found = on_circles(siblings).into_iter();
            all.extend(found.map(|line| format!("{name}, in `{folder}`: {line}")));
        }
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}

/// By folder, which of its files and folders need which others there.
fn siblings(imports: &Imports) -> BTreeMap<Module, Imports> {
    let mut folders: BTreeMap<Module, Imports> = BTreeMap::new();
    for (module, needs) in imports {
        for need in needs {
            let both = module.split("::").zip(need.split("::"));
            let same: Vec<&str> = both.take_while(|(a, b)| a == b).map(|(a, _)| a).collect();
            let sibling = |path: &str| path.split("::").nth(same.len()).map(str::to_owned);
            let (Some(from), Some(to)) = (sibling(module), sibling(need)) else {
                continue;
            };
            let folder = folders.entry(same.join("::")).or_default();
            folder.entry(to.clone()).or_default();
            folder.entry(from).or_default().insert(to);
        }
    }
    folders
}

/// What verbs share lies beside them: a verb that imports another one could not be read, or removed, alone.
#[test]
fn no_verb_imports_another_verb() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let imports = imports(&modules(&root.join("ril/src"), &[]));
    let verb_of = |module: &str| {
        let verb = module.strip_prefix("verbs::")?.split("::").next();
        verb.map(str::to_owned)
    };
    let verbs: BTreeSet<_> = imports.keys().filter_map(|file| verb_of(file)).collect();
    assert!(verbs.len() > 5, "{verbs:?}");
    for (file, needs) in &imports {
        let Some(verb) = verb_of(file) else {
            continue;
        };
        for need in needs {
            let other = verb_of(need).filter(|other| *other != verb);
            assert_eq!(other, None, "{file} imports {need}");
        }
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
        (
            "d",
            "#[cfg(test)]\nmod tests {\n    use crate::a::Ay;\n}\n\n#[cfg(test)]\nmod dee_tests {\n    use crate::b::Bee;\n}\n",
        ),
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

#[test]
fn two_folders_whose_files_are_on_no_circle_may_be_on_one() {
    let sources = [
        ("a::one", "use crate::b::one;"),
        ("b::one", ""),
        ("b::two", "use crate::a::two;"),
        ("a::two", "use super::c;"),
        ("a", "mod two; use two::Two;"),
    ];
    let modules = sources.map(|(module, source)| (module.to_owned(), source.to_owned()));
    let imports = imports(&BTreeMap::from(modules));
    assert!(on_circles(imports.clone()).is_empty());
    let found = on_circles(siblings(&imports).remove("").unwrap());
    assert_eq!(found, [r#"a imports {"b"}"#, r#"b imports {"a"}"#]);
}

#[test]
fn parents_children_and_attributes_count_too() {
    let sources = [
        ("a", "mod b;\nfn f() {\n    b::g();\n}"),
        (
            "a::b",
            "#[serde(default = super::super::c::seed())]\nstruct Bee;",
        ),
        (
            "c",
            "use crate::{\n    a as first,\n};\nmacro_rules! m { () => { $crate::a::f() } }",
        ),
        ("d", "mod e;\npub use e::Eel;"),
        (
            "d::e",
            "pub(in super::super) struct Eel;\n// super::f\nuse std::super_::x;",
        ),
        ("f", "#[command(after_help = crate::g::HELP)]\nstruct Fox;"),
        ("g", "use self::h::Hen;\nmod h;"),
        ("g::h", "type Hen = super::super::f::Fox;"),
    ];
    let modules = sources.map(|(module, source)| (module.to_owned(), source.to_owned()));
    let found = on_circles(imports(&BTreeMap::from(modules)));
    let expected = [
        r#"a imports {"a::b"}"#,
        r#"a::b imports {"c"}"#,
        r#"c imports {"a"}"#,
        r#"f imports {"g"}"#,
        r#"g imports {"g::h"}"#,
        r#"g::h imports {"f"}"#,
    ];
    assert_eq!(found, expected);
}
