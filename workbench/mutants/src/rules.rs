//! Which places of a source are changed, and into what; and the source with all of it behind switches.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::read_to_string;
use std::ops::Range;
use std::path::{Path, PathBuf};

use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{Attribute, BinOp, Block, Expr, Item, ReturnType, Signature, Stmt, UnOp};

/// One change of one place.
pub struct Mutant {
    /// Index of its room among those of the package.
    pub room: usize,
    pub file: PathBuf,
    pub line: usize,
    /// File, function and change: what stays the same when lines move.
    pub key: String,
    /// What is replaced in the file; empty: a statement at the head of a function.
    range: Range<usize>,
    code: String,
    pub is_built: bool,
}

/// The mutants of the files, but for what is compiled into tests only.
pub fn mutants(root: &Path, files: &[PathBuf], room: usize) -> Vec<Mutant> {
    let texts: Vec<_> = files.iter().map(|file| read_to_string(file).expect("a source")).collect();
    let parsed: Vec<_> = texts.iter().map(|text| syn::parse_file(text).expect("Rust")).collect();
    // A file whose `mod` is only in tests says nothing of it itself.
    let in_tests: BTreeSet<_> =
        files.iter().zip(&parsed).flat_map(|(file, it)| modules_of_tests(file, &it.items)).collect();
    let mut found = Vec::new();
    for ((file, text), parsed) in files.iter().zip(&texts).zip(&parsed) {
        if in_tests.iter().any(|module| file.starts_with(module) || file.with_extension("") == *module) {
            continue;
        }
        let name = file.strip_prefix(root).expect("a file of the copy").display().to_string();
        Finder { name, file: file.clone(), text, room, function: String::new(), found: &mut found }.visit_file(parsed);
    }
    found
}

fn modules_of_tests(file: &Path, items: &[Item]) -> Vec<PathBuf> {
    let is_root = file.ends_with("mod.rs") || file.ends_with("lib.rs");
    let folder = if is_root { file.with_file_name("") } else { file.with_extension("") };
    let modules = items.iter().filter_map(|item| match item {
        Item::Mod(module) if is_conditional(&module.attrs) => Some(folder.join(module.ident.to_string())),
        _ => None,
    });
    modules.collect()
}

fn is_conditional(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|it| it.path().is_ident("cfg") || it.path().is_ident("test"))
}

/// Puts the mutants into an order that the seed says.
pub fn shuffle(mutants: &mut [Mutant], seed: u64) {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    for index in (1..mutants.len()).rev() {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        mutants.swap(index, (state % (index as u64 + 1)) as usize);
    }
}

/// A file's text with its mutants, those that are built.
pub fn planted(text: &str, file: &Path, mutants: &[Mutant]) -> String {
    let mut places = BTreeMap::<_, Vec<usize>>::new();
    for (index, mutant) in mutants.iter().enumerate().filter(|(_, it)| it.is_built && it.file == file) {
        // The outer of two places that begin together comes first.
        places.entry((mutant.range.start, usize::MAX - mutant.range.end)).or_default().push(index);
    }
    let places: Vec<Vec<usize>> = places.into_values().collect();
    rendered(text, 0..text.len(), &mut places.as_slice(), mutants)
}

fn rendered(text: &str, part: Range<usize>, places: &mut &[Vec<usize>], mutants: &[Mutant]) -> String {
    let (mut out, mut at) = (String::new(), part.start);
    while let Some((place, rest)) = places.split_first() {
        let range = mutants[place[0]].range.clone();
        if range.start >= part.end {
            break;
        }
        *places = rest;
        out += &text[at..range.start];
        at = range.end;
        let branch = |&index: &usize| {
            let (number, code) = (index + 1, &mutants[index].code);
            format!("if crate::ril_mutant({number}) {{/*{number}<*/ {code} /*>{number}*/}}")
        };
        let branches: Vec<String> = place.iter().map(branch).collect();
        match range.is_empty() {
            true => out += &branches.join(" "),
            false => {
                let inner = rendered(text, range, places, mutants);
                out += &format!("({} else {{ {inner} }})", branches.join(" else "));
            }
        }
    }
    out + &text[at..part.end]
}

/// Leaves out the mutants in whose code a planted file's byte is; how many.
pub fn remove(file: &Path, at: usize, mutants: &mut [Mutant]) -> usize {
    let text = read_to_string(file).unwrap_or_default();
    let mut removed = 0;
    for (index, mutant) in mutants.iter_mut().enumerate().filter(|(_, it)| it.is_built && it.file == file) {
        let [start, end] = [format!("/*{}<*/", index + 1), format!("/*>{}*/", index + 1)].map(|mark| text.find(&mark));
        if start.is_some_and(|start| start <= at) && end.is_some_and(|end| at <= end) {
            mutant.is_built = false;
            removed += 1;
        }
    }
    removed
}

struct Finder<'a> {
    name: String,
    file: PathBuf,
    text: &'a str,
    room: usize,
    function: String,
    found: &'a mut Vec<Mutant>,
}

impl Finder<'_> {
    fn add(&mut self, range: Range<usize>, line: usize, from: &str, code: String) {
        let plain = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        let key = format!("{} {}: {} -> {}", self.name, self.function, plain(from), plain(&code));
        self.found.push(Mutant { room: self.room, file: self.file.clone(), line, key, range, code, is_built: true });
    }

    fn replace(&mut self, node: &impl Spanned, codes: impl IntoIterator<Item = String>) {
        let (range, line) = (node.span().byte_range(), node.span().start().line);
        let from = self.source(node);
        codes.into_iter().for_each(|code| self.add(range.clone(), line, &from, code));
    }

    fn source(&self, node: &impl Spanned) -> String {
        self.text[node.span().byte_range()].to_owned()
    }

    /// A function that does nothing, or always gives the same; then what is in it.
    fn function(&mut self, attributes: &[Attribute], signature: &Signature, block: &Block) {
        if is_conditional(attributes) || signature.constness.is_some() || block.stmts.is_empty() {
            return;
        }
        let kind: String = match &signature.output {
            ReturnType::Default => "()".to_owned(),
            ReturnType::Type(_, kind) => self.source(kind).split_whitespace().collect(),
        };
        let values: &[&str] = match kind.as_str() {
            _ if signature.asyncness.is_some() => &[],
            "()" => &["()"],
            "bool" => &["true", "false"],
            "u8" | "u16" | "u32" | "u64" | "usize" | "i32" | "i64" => &["0", "1"],
            "f32" | "f64" => &["0.0", "1.0"],
            "String" => &["String::new()"],
            _ if kind.starts_with("Option<") => &["None"],
            _ if kind.starts_with("Vec<") => &["Vec::new()"],
            _ if kind.contains("Result<()") => &["Ok(())"],
            _ if kind.contains("Result<bool") => &["Ok(true)", "Ok(false)"],
            _ => &[],
        };
        let outer = std::mem::replace(&mut self.function, signature.ident.to_string());
        let at = block.brace_token.span.open().byte_range().end;
        let body = self.source(block);
        for value in values.iter().filter(|value| body.trim_matches(['{', '}']).trim() != **value) {
            self.add(at..at, block.span().start().line, "body", format!("return {value};"));
        }
        self.visit_block(block);
        self.function = outer;
    }
}

/// What takes the place of an operator.
fn others(operator: &BinOp) -> &'static [&'static str] {
    match operator {
        BinOp::Lt(_) => &["<=", ">="],
        BinOp::Le(_) => &["<", ">"],
        BinOp::Gt(_) => &[">=", "<="],
        BinOp::Ge(_) => &[">", "<"],
        BinOp::Eq(_) => &["!="],
        BinOp::Ne(_) => &["=="],
        BinOp::And(_) => &["||"],
        BinOp::Or(_) => &["&&"],
        BinOp::Add(_) => &["-"],
        BinOp::Sub(_) | BinOp::Rem(_) => &["+"],
        BinOp::Mul(_) => &["/"],
        BinOp::Div(_) => &["*"],
        BinOp::BitAnd(_) => &["|"],
        BinOp::BitOr(_) => &["&"],
        BinOp::Shl(_) => &[">>"],
        BinOp::Shr(_) => &["<<"],
        BinOp::AddAssign(_) => &["-="],
        BinOp::SubAssign(_) => &["+="],
        BinOp::BitOrAssign(_) => &["&="],
        BinOp::BitAndAssign(_) => &["|="],
        _ => &[],
    }
}

fn has_let(expression: &Expr) -> bool {
    match expression {
        Expr::Let(_) => true,
        Expr::Binary(binary) => has_let(&binary.left) || has_let(&binary.right),
        _ => false,
    }
}

impl<'ast> Visit<'ast> for Finder<'_> {
    fn visit_expr_binary(&mut self, node: &'ast syn::ExprBinary) {
        if !has_let(&node.left) && !has_let(&node.right) {
            let (left, right) = (self.source(&node.left), self.source(&node.right));
            let changed = |other: &&str| match other.starts_with(['+', '-', '&', '|']) && other.ends_with('=') {
                true => format!("{left} {other} {right}"),
                false => format!("({left}) {other} ({right})"),
            };
            self.replace(node, others(&node.op).iter().map(changed).collect::<Vec<_>>());
        }
        visit::visit_expr_binary(self, node);
    }

    /// What is compiled into tests only is no part of the product.
    fn visit_stmt(&mut self, node: &'ast Stmt) {
        let attributes: &[Attribute] = match node {
            Stmt::Local(local) => &local.attrs,
            Stmt::Expr(Expr::If(expression), _) => &expression.attrs,
            Stmt::Expr(Expr::Block(expression), _) => &expression.attrs,
            _ => &[],
        };
        if !is_conditional(attributes) {
            visit::visit_stmt(self, node);
        }
    }

    fn visit_expr_unary(&mut self, node: &'ast syn::ExprUnary) {
        let is_changed = match node.op {
            UnOp::Not(_) => true,
            UnOp::Neg(_) => !matches!(&*node.expr, Expr::Lit(_)),
            _ => false,
        };
        if is_changed {
            self.replace(node, [self.source(&node.expr)]);
        }
        visit::visit_expr_unary(self, node);
    }

    fn visit_arm(&mut self, node: &'ast syn::Arm) {
        if let Some((_, guard)) = &node.guard
            && !has_let(guard)
        {
            self.replace(guard, ["true", "false"].map(str::to_owned));
        }
        visit::visit_arm(self, node);
    }

    fn visit_item_fn(&mut self, node: &'ast syn::ItemFn) {
        self.function(&node.attrs, &node.sig, &node.block);
    }

    fn visit_impl_item_fn(&mut self, node: &'ast syn::ImplItemFn) {
        self.function(&node.attrs, &node.sig, &node.block);
    }

    fn visit_trait_item_fn(&mut self, node: &'ast syn::TraitItemFn) {
        if let Some(block) = &node.default {
            self.function(&node.attrs, &node.sig, block);
        }
    }

    fn visit_item_mod(&mut self, node: &'ast syn::ItemMod) {
        if !is_conditional(&node.attrs) {
            visit::visit_item_mod(self, node);
        }
    }

    fn visit_expr_repeat(&mut self, node: &'ast syn::ExprRepeat) {
        self.visit_expr(&node.expr);
    }

    // Where nothing can be switched at run time.
    fn visit_item_const(&mut self, _: &'ast syn::ItemConst) {}
    fn visit_item_static(&mut self, _: &'ast syn::ItemStatic) {}
    fn visit_impl_item_const(&mut self, _: &'ast syn::ImplItemConst) {}
    fn visit_trait_item_const(&mut self, _: &'ast syn::TraitItemConst) {}
    fn visit_expr_const(&mut self, _: &'ast syn::ExprConst) {}
    fn visit_variant(&mut self, _: &'ast syn::Variant) {}
    fn visit_type(&mut self, _: &'ast syn::Type) {}
    fn visit_pat(&mut self, _: &'ast syn::Pat) {}
    fn visit_generic_argument(&mut self, _: &'ast syn::GenericArgument) {}
    fn visit_attribute(&mut self, _: &'ast Attribute) {}
}
