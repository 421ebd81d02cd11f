//! Shortened script for pages: without comments and unnecessary spaces, and with short names.

/// Names defined by the script that are shortened. None is a name of the browser, a key of the
/// data, or part of a text of the script.
const LONG: [&str; 124] = [
    "table",
    "section",
    "next_frame",
    "single",
    "ticks",
    "stride",
    "fixed",
    "rises",
    "turned",
    "scaled",
    "rows",
    "zoomed",
    "room",
    "trace",
    "slider",
    "sortable",
    "part",
    "panelOf",
    "half",
    "edge",
    "frame",
    "state",
    "high",
    "bottom",
    "name",
    "render",
    "event",
    "attributes",
    "text",
    "start",
    "right",
    "parent",
    "within",
    "draw",
    "group",
    "seen_at",
    "panel",
    "major",
    "frames",
    "low",
    "label",
    "tools",
    "button",
    "column",
    "factor",
    "least",
    "unit",
    "columns",
    "nearest",
    "svg",
    "digits",
    "legend",
    "line",
    "printing",
    "figure",
    "first",
    "other",
    "last",
    "pick",
    "change",
    "cursor",
    "inside",
    "measured",
    "middle",
    "minor",
    "power",
    "amplitude",
    "shape",
    "shown",
    "box",
    "caption",
    "head",
    "labels",
    "near",
    "options",
    "running",
    "wanted",
    "curve",
    "flat",
    "handlers",
    "list",
    "most",
    "press",
    "ORDERS",
    "all",
    "curves",
    "raised",
    "redraw",
    "rising",
    "sample",
    "sorted",
    "view",
    "NEPER",
    "crowded",
    "isShape",
    "markers",
    "place",
    "point",
    "project",
    "redraws",
    "reset",
    "waiting",
    "best",
    "made",
    "tall",
    "row",
    "across",
    "angles",
    "banded",
    "bytes",
    "choice",
    "data",
    "decade",
    "decimals",
    "down",
    "extent",
    "filled",
    "filtered",
    "given",
    "more",
    "put_in",
    "range",
    "ranges",
    "response",
];

/// Letters and digits of the short names; each short name is `$` or `_` with one of them.
const LETTERS: &[u8; 62] = b"abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789";

/// Words of the language with a shorter equivalent.
const LITERALS: [(&str, &str); 4] =
    [("const", "let"), ("undefined", "void 0"), ("true", "!0"), ("false", "!1")];

/// Returns an equivalent script with fewer characters, if the script compares only values of equal
/// types and has no empty statement.
pub(super) fn squeeze(script: &str) -> String {
    let lines = script.lines().map(str::trim);
    let lines = lines.filter(|line| !line.is_empty() && !line.starts_with("//"));
    let text: Vec<char> = lines.collect::<Vec<_>>().join("\n").chars().collect();
    let mut out = String::with_capacity(text.len());
    // This stack has the open strings and templates, and a brace for each expression within a
    // template.
    let mut open: Vec<char> = Vec::new();
    let mut at = 0;
    while at < text.len() {
        let c = text[at];
        match open.last() {
            Some('`') if c == '$' && text.get(at + 1) == Some(&'{') => {
                out.push_str("${");
                open.push('{');
                at += 2;
            }
            Some(quote @ ('"' | '`')) => {
                let is_end = c == *quote;
                out.push(c);
                if is_end {
                    open.pop();
                }
                at += 1;
            }
            _ if is_word(c) => {
                let word: String = text[at..].iter().take_while(|c| is_word(**c)).collect();
                at += word.chars().count();
                out.push_str(&short(&word));
            }
            _ => {
                match c {
                    '"' | '`' | '{' => open.push(c),
                    '}' => drop(open.pop()),
                    _ => {}
                }
                let mut following = text[at + 1..].iter().filter(|c| !c.is_whitespace());
                let is_last = c == ';' && following.next() == Some(&'}');
                let next = text.get(at + 1).copied();
                let is_equality = out.ends_with("==") || out.ends_with("!=");
                let is_blank = c.is_whitespace() && is_idle(c, out.chars().last(), next);
                if !(is_last || is_blank || c == '=' && is_equality) {
                    out.push(c);
                }
                at += 1;
            }
        }
    }
    out
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_' || c == '$'
}

/// Returns whether a space or line break between these characters is unnecessary.
fn is_idle(blank: char, before: Option<char>, after: Option<char>) -> bool {
    let (Some(before), Some(after)) = (before, after) else { return true };
    match blank {
        '\n' => ";{,([".contains(before) || "}])".contains(after),
        _ => {
            let joins_words = is_word(before) && is_word(after);
            let joins_signs = "+-".contains(before) && "+-".contains(after);
            !(joins_words || joins_signs)
        }
    }
}

fn short(word: &str) -> String {
    match LONG.iter().position(|long| *long == word) {
        Some(at) => {
            let letter = char::from(LETTERS[at % LETTERS.len()]);
            format!("{}{letter}", ["$", "_"][at / LETTERS.len()])
        }
        None => LITERALS
            .iter()
            .find(|(long, _)| *long == word)
            .map_or(word, |(_, short)| short)
            .to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strings_and_templates_stay_and_words_are_not_joined() {
        let script = "// A comment.\nconst frame = {a: \"frame === a;}\"};\n  if (a === b) {\n b = true;\n}\n  return frame + +1, `frame ${frame.x + 1} {` in b;\n";
        let f = short("frame");
        assert_eq!(
            squeeze(script),
            format!(
                "let {f}={{a:\"frame === a;}}\"}};if(a==b){{b=!0}}\nreturn {f}+ +1,`frame ${{{f}.x+1}} {{`in b;"
            )
        );
    }
}
