//! Parser for the parts of a Markdown page that the tests need: code blocks, links and anchors.

use std::collections::HashSet;
use std::ops::Range;

use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};

/// A fenced code block.
#[derive(Debug)]
pub struct Block {
    /// Text after the opening fence.
    pub info: String,
    /// Range of the text between the fences in the page.
    pub range: Range<usize>,
}

impl Block {
    /// Returns the name after `file=` in the info string: the block shows the content of this file.
    pub fn file(&self) -> Option<&str> {
        self.info.split(',').find_map(|part| part.strip_prefix("file="))
    }

    /// Returns the word before the first comma of the info string.
    pub fn language(&self) -> &str {
        self.info.split(',').next().unwrap_or_default()
    }
}

/// Links, anchors and texts of a page.
#[derive(Debug, Default)]
pub struct Page {
    pub blocks: Vec<Block>,
    /// Pieces of code in running text.
    pub codes: Vec<String>,
    /// Running text and tables without the code in them, with blanks between the pieces.
    pub prose: String,
    /// Targets of links, with the depth of the list that contains them.
    pub links: Vec<(usize, String)>,
    pub images: Vec<String>,
    /// Files that mdBook inserts for `{{#include …}}`.
    pub includes: Vec<String>,
    pub anchors: HashSet<String>,
}

impl Page {
    pub fn parse(text: &str) -> Self {
        let includes = text.split("{{#include ").skip(1).filter_map(|rest| rest.split("}}").next());
        let mut page = Self { includes: includes.map(String::from).collect(), ..Self::default() };
        let (mut depth, mut heading, mut block) = (0, None::<String>, None::<Block>);
        for (event, range) in Parser::new_ext(text, Options::ENABLE_TABLES).into_offset_iter() {
            match &event {
                Event::Code(code) => page.codes.push(code.to_string()),
                Event::Text(text) if block.is_none() => {
                    page.prose.push_str(text);
                    page.prose.push(' ');
                }
                _ => {}
            }
            match event {
                Event::Start(Tag::List(_)) => depth += 1,
                Event::End(TagEnd::List(_)) => depth -= 1,
                Event::Start(Tag::Link { dest_url, .. }) => {
                    page.links.push((depth, dest_url.into_string()));
                }
                Event::Start(Tag::Image { dest_url, .. }) => page.images.push(dest_url.to_string()),
                Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
                Event::End(TagEnd::Heading(_)) => {
                    page.anchors.extend(heading.take().map(|title| anchor(&title)));
                }
                Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(info))) => {
                    block = Some(Block { info: info.into_string(), range: 0..0 });
                }
                Event::End(TagEnd::CodeBlock) => page.blocks.extend(block.take()),
                Event::Text(part) | Event::Code(part) => {
                    if let Some(title) = &mut heading {
                        title.push_str(&part);
                    }
                    if let Some(block) = &mut block {
                        let start =
                            if block.range.is_empty() { range.start } else { block.range.start };
                        block.range = start..range.end;
                    }
                }
                Event::Html(html) | Event::InlineHtml(html) => {
                    let named =
                        html.split("id=\"").skip(1).filter_map(|rest| rest.split('"').next());
                    page.anchors.extend(named.map(String::from));
                }
                _ => {}
            }
        }
        page
    }
}

/// Returns the anchor of a heading: lower case, words joined by hyphens.
fn anchor(title: &str) -> String {
    let kept = title.to_lowercase();
    let kept = kept.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}
