//! Rules for the documentation of an item.

use syn::visit::{self, Visit};
use syn::{BinOp, Block, FnArg, GenericArgument, PathArguments, ReturnType, Signature, Type};

use crate::items::{Item, Kind};

/// Returns true if a function that returns a `Result` has no section `# Errors`.
pub fn hides_its_errors(item: &Item) -> bool {
    let Kind::Function { signature, .. } = &item.kind else { return false };
    let ReturnType::Type(_, returned) = &signature.output else { return false };
    name(returned).is_some_and(|name| name == "Result") && !has_section(&item.docs, "Errors")
}

/// Returns true if a function that computes with numbers has no section `# Source`, and neither its
/// type nor the head of its file has one.
pub fn hides_its_source(item: &Item) -> bool {
    let Kind::Function { signature, body: Some(body), .. } = &item.kind else { return false };
    computes(signature, body)
        && !has_section(&item.docs, "Source")
        && !has_section(&item.around, "Source")
        && !has_section(&item.file, "Source")
}

/// Returns true if an item has bare numbers, but its documentation names no unit and does not say
/// that they have none.
pub fn hides_its_units(item: &Item) -> bool {
    let carries = |ty: &Type| mentions(ty, &["f64", "DVector", "DMatrix", "DMatrixView"]);
    carries_some(item, carries) && !says(item, UNITS)
}

/// Returns true if an item has lists or matrices of numbers, but its documentation does not state
/// their length or shape.
pub fn hides_its_shape(item: &Item) -> bool {
    let slice =
        |ty: &Type| matches!(ty, Type::Reference(of) if matches!(&*of.elem, Type::Slice(_)));
    let shaped = |ty: &Type| {
        mentions(ty, &["DVector", "DMatrix", "DMatrixView"])
            || (slice(ty) || mentions(ty, &["Vec"])) && mentions(ty, &["f64", "Complex"])
    };
    carries_some(item, shaped) && !says(item, SHAPES)
}

/// Returns true if the first line of the documentation is a fragment. It must begin with a verb in
/// the third person (“Returns …”) or with a noun, not with a question word, a pronoun, a
/// conjunction or a preposition.
pub fn begins_with_a_fragment(item: &Item) -> bool {
    let word = item.docs.split(|c: char| !c.is_alphabetic() && c != '\'').find(|w| !w.is_empty());
    // A formula, a symbol or a name in code counts as a noun.
    let is_word = item.docs.trim_start().starts_with(|c: char| c.is_alphabetic());
    is_word && word.is_some_and(|word| FRAGMENTS.contains(&word))
}

/// First words that mark a fragment.
const FRAGMENTS: &[&str] = &[
    "Above",
    "After",
    "Also",
    "And",
    "Anything",
    "As",
    "At",
    "Because",
    "Before",
    "Behind",
    "Below",
    "Beside",
    "Between",
    "But",
    "By",
    "Everything",
    "From",
    "How",
    "If",
    "In",
    "Into",
    "It",
    "Its",
    "Like",
    "Likewise",
    "Neither",
    "Nor",
    "Not",
    "Nothing",
    "Of",
    "On",
    "Or",
    "Out",
    "Over",
    "Since",
    "So",
    "Something",
    "Such",
    "That",
    "Their",
    "Them",
    "Then",
    "There",
    "These",
    "They",
    "This",
    "Those",
    "Thus",
    "To",
    "Under",
    "Until",
    "Up",
    "What",
    "When",
    "Where",
    "Whether",
    "Which",
    "While",
    "Who",
    "Why",
    "With",
    "Without",
];

/// Words that name a unit, or say that there is none; one of them suffices.
const UNITS: &[&str] = &[
    "N",
    "m",
    "kg",
    "s",
    "Hz",
    "rad",
    "N/m",
    "N·s/m",
    "N·s",
    "m/s",
    "m/s²",
    "rad/s",
    "1/s",
    "m/N",
    "seconds",
    "second",
    "dB",
    "%",
    "per cent",
    "degrees",
    "unit",
    "units",
    "dimensionless",
    "pure number",
    "pure numbers",
    "ratio",
    "ratios",
    "share",
    "part",
    "fraction",
    "factor",
    "probability",
    "Pa",
    "Pa·s",
    "N²",
    "m²",
    "N/√s",
    "px",
    "pixels",
];

/// Words that state a length or a shape; one of them suffices.
const SHAPES: &[&str] = &[
    "×", "row", "rows", "column", "columns", "each", "per", "square", "length", "samples",
    "sample", "channels", "channel", "lines", "line", "entries", "n", "one for", "diagonal",
    "every", "degree", "degrees", "state", "list", "periods",
];

fn says(item: &Item, words: &[&str]) -> bool {
    let text = format!("{}\n{}", item.docs, item.around);
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let parts: Vec<&str> =
        text.split(|c: char| c.is_whitespace() || ",;:()[]`.".contains(c)).collect();
    let is = |part: &str, word: &str| match word.chars().all(char::is_lowercase) {
        // A word of more than three letters may have a capital letter, as at the beginning of a
        // sentence; a shorter word is a unit, whose spelling is fixed.
        true if word.len() > 3 => part.eq_ignore_ascii_case(word),
        _ => part == word,
    };
    words.iter().any(|word| match word.contains(' ') {
        true => text.contains(word),
        false => parts.iter().any(|part| is(part, word)),
    })
}

fn has_section(docs: &str, heading: &str) -> bool {
    docs.lines().any(|line| line.trim() == format!("# {heading}"))
}

fn carries_some(item: &Item, carries: impl Fn(&Type) -> bool) -> bool {
    match &item.kind {
        Kind::Type | Kind::Variant | Kind::Constant | Kind::Head => false,
        Kind::Field(ty) => carries(ty),
        Kind::Function { signature, .. } => types(signature).iter().any(|ty| carries(ty)),
    }
}

fn types(signature: &Signature) -> Vec<&Type> {
    let mut types: Vec<&Type> = signature
        .inputs
        .iter()
        .filter_map(|input| match input {
            FnArg::Typed(argument) => Some(&*argument.ty),
            FnArg::Receiver(_) => None,
        })
        .collect();
    if let ReturnType::Type(_, returned) = &signature.output {
        types.push(returned);
    }
    types
}

fn name(ty: &Type) -> Option<String> {
    match ty {
        Type::Path(path) => path.path.segments.last().map(|segment| segment.ident.to_string()),
        _ => None,
    }
}

/// Returns true if the type has one of these names, or contains a type that has one of them.
fn mentions(ty: &Type, names: &[&str]) -> bool {
    match ty {
        Type::Reference(inner) => mentions(&inner.elem, names),
        Type::Slice(inner) => mentions(&inner.elem, names),
        Type::Array(inner) => mentions(&inner.elem, names),
        Type::Tuple(inner) => inner.elems.iter().any(|ty| mentions(ty, names)),
        Type::Path(path) => path.path.segments.iter().any(|segment| {
            names.iter().any(|name| segment.ident == name) || match &segment.arguments {
                PathArguments::AngleBracketed(all) => all.args.iter().any(
                    |argument| matches!(argument, GenericArgument::Type(ty) if mentions(ty, names)),
                ),
                _ => false,
            }
        }),
        _ => false,
    }
}

/// Maximum number of arithmetic operations that need no source, in a function body of several
/// statements: enough for a conversion, a ratio or a sum of two terms.
const PLAIN: usize = 2;

/// Maximum number of arithmetic operations that need no source, in a function body that is one
/// expression: the code itself shows the formula.
const FORMULA: usize = 4;

/// Returns true if a function with numbers in its signature computes with them; to pass them on,
/// compare, convert or select them does not count.
fn computes(signature: &Signature, body: &Block) -> bool {
    let numbers = ["f64", "DVector", "DMatrix", "Complex", "Record", "Spectrum", "Response"];
    if !types(signature).iter().any(|ty| mentions(ty, &numbers)) || picks(signature) {
        return false;
    }
    let mut work = Work::default();
    work.visit_block(body);
    let formula = matches!(&body.stmts[..], [syn::Stmt::Expr(..)]);
    work.operations > if formula { FORMULA } else { PLAIN }
}

/// Returns true if a function returns indices, words, true or false, or a reference to existing
/// data.
fn picks(signature: &Signature) -> bool {
    let ReturnType::Type(_, returned) = &signature.output else { return false };
    let counts = mentions(returned, &["usize", "bool", "String"]) && !mentions(returned, &["f64"]);
    counts || matches!(&**returned, Type::Reference(_))
}

/// Counter of the arithmetic operations in the body of a function.
#[derive(Default)]
struct Work {
    operations: usize,
}

impl<'ast> Visit<'ast> for Work {
    fn visit_expr_binary(&mut self, expression: &'ast syn::ExprBinary) {
        let arithmetic = matches!(
            expression.op,
            BinOp::Mul(_)
                | BinOp::Div(_)
                | BinOp::Add(_)
                | BinOp::Sub(_)
                | BinOp::MulAssign(_)
                | BinOp::DivAssign(_)
                | BinOp::AddAssign(_)
                | BinOp::SubAssign(_)
        );
        self.operations += usize::from(arithmetic);
        visit::visit_expr_binary(self, expression);
    }

    fn visit_expr_for_loop(&mut self, expression: &'ast syn::ExprForLoop) {
        self.operations += 1;
        visit::visit_expr_for_loop(self, expression);
    }

    /// The arithmetic of an index does not count.
    fn visit_expr_index(&mut self, expression: &'ast syn::ExprIndex) {
        self.visit_expr(&expression.expr);
    }

    fn visit_expr_method_call(&mut self, call: &'ast syn::ExprMethodCall) {
        let solvers = ["lu", "svd", "qr", "schur", "symmetric_eigen", "cholesky", "solve", "exp"];
        if solvers.iter().any(|name| call.method == name) {
            self.operations += PLAIN + 1;
        }
        visit::visit_expr_method_call(self, call);
    }
}
