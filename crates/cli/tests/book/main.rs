//! README and book show exactly what the program prints and draws; their code compiles, and every
//! link has a target.
//!
//! The commands in a page's `console` blocks are run in order; a chapter and the pages below it in
//! the book's summary share one folder. The summary's groups without a page share none.
//! `MECHID_BLESS=1 cargo test -p mechid-cli --test book` writes the answers and pictures anew.
//! Pages of the gallery are tested only if their records are present.

mod commands;
mod gallery;
mod markdown;
mod numbers;
mod pictures;
mod runs;
mod session;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use commands::Workspace;
use markdown::Page;
use runs::Programs;
use session::{Session, Step, fits};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn bless() -> bool {
    std::env::var_os("MECHID_BLESS").is_some()
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Returns the text of a page, followed by the texts of the files that it includes.
fn whole(path: &Path) -> String {
    let text = read(path);
    let includes = Page::parse(&text).includes;
    includes
        .iter()
        .fold(text.clone(), |text, file| text + &read(&path.parent().unwrap().join(file)))
}

/// Returns the pages of the book in groups that share a folder: a chapter with the pages below it.
/// An entry of the summary without a page is only a heading; the pages directly below it are
/// separate chapters.
fn chapters() -> Vec<Vec<PathBuf>> {
    let source = root().join("docs/book/src");
    let mut chapters: Vec<Vec<PathBuf>> = Vec::new();
    let mut chapter_depth = 1;
    for (depth, target) in Page::parse(&read(&source.join("SUMMARY.md"))).links {
        if target.is_empty() {
            chapter_depth = depth + 1;
            continue;
        }
        chapter_depth = chapter_depth.min(depth.max(1));
        match chapters.last_mut() {
            Some(chapter) if depth > chapter_depth => chapter.push(source.join(target)),
            _ => chapters.push(vec![source.join(target)]),
        }
    }
    chapters
}

/// Returns the README and every page below `docs`.
fn documents() -> Vec<PathBuf> {
    let mut documents = vec![root().join("README.md")];
    let mut folders = vec![root().join("docs")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "md") {
                documents.push(path);
            }
        }
    }
    documents
}

/// Faults found in the pages.
#[derive(Default)]
struct Findings {
    /// Answers and pictures that differ from those of the program; a run with `MECHID_BLESS=1`
    /// replaces them.
    stale: Vec<String>,
    /// Faults that only an author can correct.
    wrong: Vec<String>,
}

/// Runs the commands of a page; returns its text with the answers of the program.
fn follow(page: &Path, session: &mut Session, findings: &mut Findings) -> String {
    let text = read(page);
    let (mut today, mut copied) = (String::new(), 0);
    for block in Page::parse(&text).blocks {
        let content = &text[block.range.clone()];
        if block.language() == "sh" {
            findings.wrong.extend(content.lines().filter_map(|line| session.walk(line).err()));
        }
        if let Some(file) = block.file() {
            session.write(file, content);
        }
        if block.language() != "console" {
            continue;
        }
        today.push_str(&text[copied..block.range.start]);
        copied = block.range.end;
        for step in Step::all(content) {
            today.push_str(&step.typed);
            let place = format!("{}\n{}", page.display(), step.typed);
            match session.run(&step.command()) {
                Ok(answer) if !fits(&step.shown, &answer) => {
                    findings.stale.push(format!("{place}shows\n{}is\n{answer}", step.shown));
                    today.push_str(&answer);
                }
                Ok(_) => today.push_str(&step.shown),
                Err(why) => {
                    findings.wrong.push(format!("{place}{why}"));
                    today.push_str(&step.shown);
                }
            }
        }
    }
    today + &text[copied..]
}

/// Compares a page's pictures with those that its commands drew.
fn look(page: &Path, session: &Session, findings: &mut Findings) {
    for image in Page::parse(&read(page)).images {
        let committed = page.parent().unwrap().join(&image);
        let name = committed.file_name().unwrap().to_string_lossy();
        match session.read(&name) {
            Some(drawn) if committed.exists() && pictures::alike(&drawn, &read(&committed)) => {}
            Some(drawn) if bless() => fs::write(&committed, drawn).unwrap(),
            Some(_) => findings.stale.push(format!("{} is drawn otherwise", committed.display())),
            // `cargo xtask` and the test `film_in_motion` draw and compare these pictures.
            None if ["thesis/", "film_in_motion/"].iter().any(|drawn| image.contains(drawn)) => {}
            // This picture shows measured times, which differ in every run.
            None if image == "cost.svg" => {}
            None => findings.wrong.push(format!("{}: nothing draws {image}", page.display())),
        }
    }
}

#[test]
fn commands_print_and_draw_what_the_pages_show() {
    let mut findings = Findings::default();
    for chapter in [vec![vec![root().join("README.md")]], chapters()].concat() {
        let mut session = Session::new(&root());
        if !chapter.iter().all(|page| gallery::has_its_record(page, &session)) {
            continue;
        }
        for page in &chapter {
            let today = follow(page, &mut session, &mut findings);
            if bless() && today != read(page) {
                fs::write(page, today).unwrap();
            }
        }
        for page in &chapter {
            look(page, &session, &mut findings);
        }
    }
    assert!(findings.wrong.is_empty(), "{}", findings.wrong.join("\n"));
    let stale = findings.stale.join("\n");
    assert!(bless() || stale.is_empty(), "{stale}\nMECHID_BLESS=1 writes the pages anew");
}

#[test]
fn every_link_leads_somewhere() {
    let mut broken = Vec::new();
    for document in documents() {
        let page = Page::parse(&read(&document));
        let targets = page.links.iter().map(|(_, target)| target);
        let targets = targets.chain(&page.images).chain(&page.includes);
        for target in targets.filter(|target| !target.contains("://")) {
            let (file, anchor) = target.split_once('#').unwrap_or((target, ""));
            let path = match file {
                "" => document.clone(),
                _ => document.parent().unwrap().join(file),
            };
            let known = |path: &Path| Page::parse(&whole(path)).anchors.contains(anchor);
            if !path.exists() || !(anchor.is_empty() || known(&path)) {
                broken.push(format!("{}: {target}", document.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn every_page_can_be_found() {
    let summary: BTreeSet<PathBuf> =
        chapters().concat().iter().map(|page| page.canonicalize().unwrap()).collect();
    let source = root().join("docs/book/src");
    let mut linked = BTreeSet::from([root().join("README.md"), source.join("SUMMARY.md")]);
    for document in documents() {
        for (_, target) in Page::parse(&read(&document)).links {
            let file = target.split('#').next().unwrap();
            linked.extend(document.parent().unwrap().join(file).canonicalize().ok());
        }
    }
    for document in documents() {
        let shelf = if document.starts_with(&source) { &summary } else { &linked };
        assert!(
            shelf.contains(&document) || document.ends_with("SUMMARY.md"),
            "no way leads to {}",
            document.display()
        );
    }
}

/// If a code block shows a file, the text of the page must name the file, because the opening line
/// of the block, which names it, is not visible in the book.
#[test]
fn readers_are_told_what_to_call_a_file() {
    for page in chapters().concat() {
        let page_text = read(&page);
        let parsed = Page::parse(&page_text);
        for file in parsed.blocks.iter().filter_map(markdown::Block::file) {
            let named = parsed.codes.iter().any(|code| code == file);
            assert!(named, "{}: the text does not say `{file}`", page.display());
        }
    }
}

/// Every number of three or more digits in the text of the introduction and the tutorial also
/// appears in a code block of the same chapter; the text may round it.
#[test]
fn the_tutorial_says_what_its_blocks_show() {
    let mut looked_at = 0;
    for chapter in chapters() {
        let told = ["introduction.md", "tutorial/index.md"];
        if !told.iter().any(|name| chapter[0].ends_with(name)) {
            continue;
        }
        let pages: Vec<(String, Page)> = chapter
            .iter()
            .map(|page| read(page))
            .map(|text| (text.clone(), Page::parse(&text)))
            .collect();
        let blocks = pages.iter().flat_map(|(text, page)| {
            page.blocks.iter().map(|block| text[block.range.clone()].to_owned())
        });
        let shown: Vec<f64> = blocks.flat_map(|block| numbers::all(&block)).collect();
        for (_, page) in &pages {
            for number in numbers::written(&page.prose) {
                let is_shown = shown.iter().any(|shown| number.is_of(*shown));
                assert!(
                    is_shown,
                    "{}: no block of the chapter shows {}",
                    chapter[0].display(),
                    number.text
                );
                looked_at += 1;
            }
        }
    }
    assert!(looked_at > 30, "{looked_at} numbers");
}

/// Rows of tables fit on a screen of 100 columns; two or more blanks separate their cells.
#[test]
fn tables_fit_on_a_screen() {
    let mut rows = 0;
    for page in documents() {
        let text = read(&page);
        for block in Page::parse(&text).blocks.iter().filter(|block| block.language() == "console")
        {
            for line in text[block.range.clone()].lines() {
                let cells = line.trim().split("  ").filter(|cell| !cell.is_empty()).count();
                if cells > 2 {
                    assert!(line.chars().count() <= 100, "{}: {line}", page.display());
                    rows += 1;
                }
            }
        }
    }
    assert!(rows > 100, "{rows} rows");
}

/// Returns every shell command of the pages, in blocks and in running text, with its page. Commands
/// that make or enter a folder are excluded.
fn shell_lines(wrong: &mut Vec<String>) -> Vec<(PathBuf, String)> {
    let mut all = Vec::new();
    for document in documents() {
        let text = read(&document);
        let page = Page::parse(&text);
        let mut lines: Vec<String> = page.codes.clone();
        lines.retain(|code| commands::BEGINNINGS.iter().any(|start| code.starts_with(start)));
        for block in &page.blocks {
            let content = text[block.range.clone()].replace("\\\n", " ");
            let place = document.display();
            match block.language() {
                "sh" => lines.extend(content.lines().map(String::from)),
                "console" | "rust" | "json" | "text" => {}
                // `crates/python/tests/test_pages.py` runs these blocks and compares their output.
                "python" => {}
                other => wrong.push(format!("{place}: nothing tests a block of \"{other}\"")),
            }
            let typed = |line: &&str| {
                ["$ ", "mechid "].iter().chain(&commands::BEGINNINGS).any(|b| line.starts_with(b))
            };
            if block.language() == "text" {
                let typed = content.lines().find(typed);
                wrong.extend(typed.map(|line| format!("{place}: a command as text: {line}")));
            }
        }
        lines.retain(|line| !Session::walks(line));
        all.extend(lines.into_iter().map(|line| (document.clone(), line)));
    }
    all
}

#[test]
fn every_command_is_run() {
    let workspace = Workspace::of(&root());
    let (mut wrong, mut runs) = (Vec::new(), BTreeSet::new());
    for (document, line) in shell_lines(&mut wrong) {
        match workspace.meaning(&line) {
            Ok(run) => drop(runs.insert(run)),
            Err(why) => wrong.push(format!("{}: {line}: {why}", document.display())),
        }
    }
    let programs = Programs::of(&root(), &runs);
    wrong.extend(runs::go_all(&runs, &root(), &programs));
    assert!(runs.len() > 6, "{runs:?}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Subcommands and options named in the pages exist in the help of the program.
#[test]
fn options_in_running_text_exist() {
    let help = |arguments: &[&str]| {
        let output = Command::cargo_bin("mechid").unwrap().args(arguments).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    let all = read(&root().join("docs/book/src/reference/commands.md"));
    let has = |help: &str, option: &str| {
        help.split(|c: char| c.is_whitespace() || ",[]()".contains(c)).any(|word| word == option)
    };
    let (mut wrong, mut looked_at) = (Vec::new(), 0);
    for document in documents() {
        for code in Page::parse(&read(&document)).codes {
            let mut words = code.split_whitespace();
            let known = match words.next() {
                Some("mechid") => match words.next() {
                    Some(name) if !name.starts_with('-') => help(&[name, "--help"]),
                    _ => help(&["--help"]),
                },
                Some(option) if option.starts_with("--") => all.clone(),
                _ => continue,
            };
            let options = code.split_whitespace().filter(|word| word.starts_with("--"));
            let missing = options.filter(|option| !has(&known, option)).count();
            if known.is_empty() || missing > 0 {
                wrong.push(format!("{}: {code}", document.display()));
            }
            looked_at += 1;
        }
    }
    assert!(wrong.is_empty() && looked_at > 40, "{looked_at} looked at\n{}", wrong.join("\n"));
}

/// `cargo test --doc` compiles and runs the Rust blocks of all pages that the crate `mechid`
/// includes.
#[test]
fn the_rust_of_every_page_is_compiled() {
    let facade = read(&root().join("crates/mechid/src/lib.rs"));
    for document in documents() {
        let rust =
            Page::parse(&read(&document)).blocks.iter().any(|block| block.language() == "rust");
        let name = document.strip_prefix(root()).unwrap().display().to_string();
        assert!(
            !rust || facade.contains(&format!("\"../../../{name}\"")),
            "crates/mechid/src/lib.rs does not name {name}"
        );
    }
}

#[test]
fn the_reference_has_every_subcommand() {
    let help = Command::cargo_bin("mechid").unwrap().arg("--help").output().unwrap().stdout;
    let help = String::from_utf8(help).unwrap();
    let list = help.split("Commands:\n").nth(1).unwrap().split("\n\n").next().unwrap();
    let page = read(&root().join("docs/book/src/reference/commands.md"));
    let mut commands = 0;
    // Names are indented by two blanks, continued descriptions by more.
    for line in list.lines().filter(|line| !line.starts_with("   ")) {
        let name = line.split_whitespace().next().unwrap();
        assert!(name == "help" || page.contains(&format!("$ mechid {name} --help\n")), "{name}");
        commands += 1;
    }
    assert!(commands > 8, "{list}");
}

/// The page on the reproduction of the dissertation and the generated audit contain the same
/// sentence with counts.
#[test]
fn the_book_counts_as_the_audit_does() {
    let audit = read(&root().join("docs/thesis/audit.md"));
    let count = audit.lines().find(|line| line.starts_with("Of ") && line.contains("estimates"));
    let sentence = count.unwrap().split_inclusive('.').next().unwrap();
    let page = read(&root().join("docs/book/src/reproduction.md"));
    assert!(page.contains(sentence), "{sentence}");
}

/// The committed record agrees with the simulation of its description, to rounding.
#[test]
fn the_example_record_is_that_of_its_description() {
    let examples = root().join("examples");
    let experiment = mechid::io::Experiment::read(examples.join("machine.json")).unwrap();
    let simulation = mechid::simulate(&experiment).unwrap();
    let table = mechid::io::Table::read(examples.join("machine.csv")).unwrap();
    let measured = &simulation.measured_response;
    for (name, record) in [
        ("force", &simulation.measured_force),
        ("displacement", measured.displacement()),
        ("velocity", measured.velocity()),
        ("acceleration", measured.acceleration()),
    ] {
        let column = table.column(name).unwrap();
        let size = record.column(0).amax();
        for (read, made) in column.iter().zip(record.channel(0)) {
            // Sine and cosine may differ in the last digit on other processors.
            assert!((read - made).abs() < 1e-12 * size, "{name}: {read} {made}");
        }
    }
}
