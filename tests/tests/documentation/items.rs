//! The public items of a crate, read from its sources.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use syn::{
    Attribute, Block, Expr, Fields, ImplItem, Lit, Meta, Signature, TraitItem, Type, UseTree,
};
use syn::{Visibility, spanned::Spanned};

/// Sources of a crate, parsed.
pub struct Source {
    modules: Vec<Module>,
    /// Names that some `pub use` exports.
    exported: BTreeSet<String>,
}

struct Module {
    file: String,
    /// True if the module and all modules around it are public.
    open: bool,
    /// Documentation at the head of the file.
    docs: String,
    items: Vec<syn::Item>,
}

/// Kind of an item.
pub enum Kind {
    Function {
        signature: Box<Signature>,
        body: Option<Box<Block>>,
        of: Option<String>,
    },
    /// A public field, or a field of a public variant.
    Field(Box<Type>),
    /// A type; its fields are separate items.
    Type,
    /// A variant of a public enum; its fields are separate items.
    Variant,
    /// A constant, in a module or of a type.
    Constant,
    /// The head of a file.
    Head,
}

/// A public item with its documentation.
pub struct Item {
    pub place: String,
    pub docs: String,
    /// Documentation of the type that contains the item; for a field of a variant, documentation of
    /// the variant.
    pub around: String,
    /// Documentation at the head of the file that contains the item.
    pub file: String,
    pub kind: Kind,
}

impl Source {
    /// Reads the crate whose `lib.rs` is in this folder.
    pub fn of(folder: &Path) -> Self {
        let mut source = Self { modules: Vec::new(), exported: BTreeSet::new() };
        source.read(&folder.join("lib.rs"), folder, true);
        source
    }

    /// Reads a crate of one file from its text.
    pub fn of_text(text: &str) -> Self {
        let mut source = Self { modules: Vec::new(), exported: BTreeSet::new() };
        let file = syn::parse_file(text).unwrap();
        source.take("text".into(), file.items, docs(&file.attrs), None, true);
        source
    }

    fn read(&mut self, path: &Path, below: &Path, open: bool) {
        let text = fs::read_to_string(path).unwrap();
        let file = syn::parse_file(&text).unwrap();
        let name = path.components().rev().take(3).collect::<Vec<_>>();
        let name: PathBuf = name.into_iter().rev().collect();
        self.take(name.display().to_string(), file.items, docs(&file.attrs), Some(below), open);
    }

    fn take(
        &mut self,
        file: String,
        mut items: Vec<syn::Item>,
        docs: String,
        below: Option<&Path>,
        open: bool,
    ) {
        items.retain(|item| !is_for_tests(item));
        for item in &items {
            match item {
                syn::Item::Use(used) if is_public(&used.vis) => self.export(&used.tree),
                syn::Item::Mod(module) => {
                    let (open, name) = (open && is_public(&module.vis), module.ident.to_string());
                    if let Some((_, inner)) = &module.content {
                        self.take(file.clone(), inner.clone(), String::new(), below, open);
                    } else if let Some(below) = below {
                        let flat = below.join(format!("{name}.rs"));
                        let nested = below.join(&name).join("mod.rs");
                        let path = if flat.exists() { flat } else { nested };
                        self.read(&path, &below.join(&name), open);
                    }
                }
                _ => {}
            }
        }
        self.modules.push(Module { file, open, docs, items });
    }

    fn export(&mut self, tree: &UseTree) {
        match tree {
            UseTree::Path(path) => self.export(&path.tree),
            UseTree::Group(group) => group.items.iter().for_each(|tree| self.export(tree)),
            UseTree::Name(name) => drop(self.exported.insert(name.ident.to_string())),
            UseTree::Rename(name) => drop(self.exported.insert(name.ident.to_string())),
            UseTree::Glob(_) => {}
        }
    }

    /// Returns all items that other crates can name, with their fields and methods.
    pub fn items(&self) -> Vec<Item> {
        let mut types = BTreeMap::new();
        let mut found = Vec::new();
        for module in &self.modules {
            found.extend((!module.docs.is_empty()).then(|| Item::head(module)));
            for item in &module.items {
                self.declared(module, item, &mut types, &mut found);
            }
        }
        for module in &self.modules {
            for item in &module.items {
                if let syn::Item::Impl(block) = item {
                    methods(module, block, &types, &mut found);
                }
            }
        }
        found
    }

    fn declared(
        &self,
        module: &Module,
        item: &syn::Item,
        types: &mut BTreeMap<String, String>,
        found: &mut Vec<Item>,
    ) {
        let reached = |vis: &Visibility, name: &syn::Ident| {
            is_public(vis) && (module.open || self.exported.contains(&name.to_string()))
        };
        match item {
            syn::Item::Const(own) if reached(&own.vis, &own.ident) => {
                found.push(Item::new(module, &own.ident, &own.attrs, "", Kind::Constant));
            }
            syn::Item::Fn(function) if reached(&function.vis, &function.sig.ident) => {
                let (signature, body) = (function.sig.clone(), Some(function.block.clone()));
                let kind = Kind::Function { signature: Box::new(signature), body, of: None };
                found.push(Item::new(module, &function.sig.ident, &function.attrs, "", kind));
            }
            syn::Item::Struct(own) if reached(&own.vis, &own.ident) => {
                let said = docs(&own.attrs);
                types.insert(own.ident.to_string(), said.clone());
                found.push(Item::new(module, &own.ident, &own.attrs, "", Kind::Type));
                fields(module, &own.fields, "", true, found);
            }
            syn::Item::Enum(own) if reached(&own.vis, &own.ident) => {
                types.insert(own.ident.to_string(), docs(&own.attrs));
                found.push(Item::new(module, &own.ident, &own.attrs, "", Kind::Type));
                for variant in &own.variants {
                    found.push(Item::new(
                        module,
                        &variant.ident,
                        &variant.attrs,
                        "",
                        Kind::Variant,
                    ));
                    let said = docs(&variant.attrs) + &message(&variant.attrs);
                    fields(module, &variant.fields, &said, false, found);
                }
            }
            syn::Item::Trait(own) if reached(&own.vis, &own.ident) => {
                let said = docs(&own.attrs);
                found.push(Item::new(module, &own.ident, &own.attrs, "", Kind::Type));
                for method in &own.items {
                    let TraitItem::Fn(method) = method else { continue };
                    let (signature, body) = (method.sig.clone(), method.default.clone());
                    let of = Some(own.ident.to_string());
                    let kind = Kind::Function {
                        signature: Box::new(signature),
                        body: body.map(Box::new),
                        of,
                    };
                    found.push(Item::new(module, &method.sig.ident, &method.attrs, &said, kind));
                }
            }
            _ => {}
        }
    }
}

impl Item {
    fn head(module: &Module) -> Self {
        let (docs, around, file) = (module.docs.clone(), String::new(), module.docs.clone());
        Self { place: format!("{}:1", module.file), docs, around, file, kind: Kind::Head }
    }

    fn new(
        module: &Module,
        name: &syn::Ident,
        attributes: &[Attribute],
        around: &str,
        kind: Kind,
    ) -> Self {
        let of = match &kind {
            Kind::Function { of: Some(of), .. } => format!("{of}::"),
            _ => String::new(),
        };
        Self {
            place: format!("{}:{}: {of}{name}", module.file, name.span().start().line),
            docs: docs(attributes) + &message(attributes),
            around: around.to_owned(),
            file: module.docs.clone(),
            kind,
        }
    }
}

/// Collects the public methods and constants of an `impl` block without a trait.
fn methods(
    module: &Module,
    block: &syn::ItemImpl,
    types: &BTreeMap<String, String>,
    found: &mut Vec<Item>,
) {
    let Type::Path(own) = &*block.self_ty else { return };
    let name = own.path.segments.last().unwrap().ident.to_string();
    let (None, Some(said)) = (&block.trait_, types.get(&name)) else { return };
    for method in &block.items {
        if let ImplItem::Const(own) = method
            && is_public(&own.vis)
        {
            found.push(Item::new(module, &own.ident, &own.attrs, said, Kind::Constant));
        }
        let ImplItem::Fn(method) = method else { continue };
        if is_public(&method.vis) {
            let kind = Kind::Function {
                signature: Box::new(method.sig.clone()),
                body: Some(Box::new(method.block.clone())),
                of: Some(name.clone()),
            };
            found.push(Item::new(module, &method.sig.ident, &method.attrs, said, kind));
        }
    }
}

fn fields(module: &Module, all: &Fields, said: &str, need_pub: bool, found: &mut Vec<Item>) {
    for (at, field) in all.iter().enumerate() {
        if need_pub && !is_public(&field.vis) {
            continue;
        }
        let at = syn::Ident::new(&format!("field_{at}"), field.ty.span());
        let name = field.ident.clone().unwrap_or(at);
        let kind = Kind::Field(Box::new(field.ty.clone()));
        found.push(Item::new(module, &name, &field.attrs, said, kind));
    }
}

fn is_public(vis: &Visibility) -> bool {
    matches!(vis, Visibility::Public(_))
}

fn is_for_tests(item: &syn::Item) -> bool {
    let attributes = match item {
        syn::Item::Mod(own) => &own.attrs,
        syn::Item::Fn(own) => &own.attrs,
        _ => return false,
    };
    attributes.iter().any(|a| match &a.meta {
        Meta::List(list) => a.path().is_ident("cfg") && list.tokens.to_string().contains("test"),
        _ => false,
    })
}

fn docs(attributes: &[Attribute]) -> String {
    let lines = attributes.iter().filter_map(|attribute| match &attribute.meta {
        Meta::NameValue(meta) if meta.path.is_ident("doc") => match &meta.value {
            Expr::Lit(text) => match &text.lit {
                Lit::Str(text) => Some(text.value() + "\n"),
                _ => None,
            },
            _ => None,
        },
        _ => None,
    });
    lines.collect()
}

/// Returns the message of an error, from its attribute `error`.
fn message(attributes: &[Attribute]) -> String {
    let shown = attributes.iter().filter(|a| a.path().is_ident("error"));
    shown
        .filter_map(|a| match &a.meta {
            Meta::List(list) => Some(list.tokens.to_string() + "\n"),
            _ => None,
        })
        .collect()
}
