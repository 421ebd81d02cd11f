//! What the tests need to know of a Markdown page: its code blocks, links and anchors.

use std::collections::HashSet;
use std::ops::Range;

use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};

/// A fenced code block.
#[derive(Debug)]
pub struct Block {
    /// What follows the opening fence.
    pub info: String,
    /// Where in the page the text between the fences is.
    pub range: Range<usize>,
}

impl Block {
    /// The name after `file=` in the info string: the block is the content of that file.
    pub fn file(&self) -> Option<&str> {
        self.info.split(',').find_map(|part| part.strip_prefix("file="))
    }

    /// The word before the first comma.
    pub fn language(&self) -> &str {
        self.info.split(',').next().unwrap_or_default()
    }
}

/// What a page refers to, and what may be referred to in it.
#[derive(Debug, Default)]
pub struct Page {
    pub blocks: Vec<Block>,
    /// Code in running text.
    pub codes: Vec<String>,
    /// Running text and tables without the code in them, with blanks between the pieces.
    pub prose: String,
    /// Targets of links with the depth of the list they stand in.
    pub links: Vec<(usize, String)>,
    pub images: Vec<String>,
    /// Files that mdBook puts in the place of `{{#include …}}`.
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

/// The anchor of a heading: lower case, words joined by hyphens.
fn anchor(title: &str) -> String {
    let kept = title.to_lowercase();
    let kept = kept.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}
