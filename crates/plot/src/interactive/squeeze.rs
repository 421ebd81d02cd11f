//! Shortened script for pages: without comments and unnecessary spaces, and with short names.

/// Names defined by the script that are shortened. None is a name of the browser, a key of the
/// data, or part of a text of the script.
const LONG: [&str; 105] = [
    "frame",
    "state",
    "name",
    "high",
    "text",
    "low",
    "draw",
    "event",
    "start",
    "render",
    "unit",
    "line",
    "parent",
    "group",
    "panel",
    "major",
    "tools",
    "label",
    "pick",
    "last",
    "within",
    "least",
    "frames",
    "attributes",
    "column",
    "seen_at",
    "head",
    "digits",
    "button",
    "most",
    "other",
    "list",
    "nearest",
    "legend",
    "power",
    "point",
    "minor",
    "factor",
    "shown",
    "best",
    "curve",
    "inside",
    "cursor",
    "figure",
    "middle",
    "change",
    "press",
    "room",
    "flat",
    "curves",
    "given",
    "columns",
    "labels",
    "reset",
    "wanted",
    "measured",
    "rising",
    "sample",
    "trace",
    "place",
    "spot",
    "running",
    "ticks",
    "printing",
    "raised",
    "options",
    "back",
    "redraws",
    "choice",
    "rises",
    "markers",
    "flush",
    "crowded",
    "chain",
    "band",
    "caption",
    "boxed",
    "waiting",
    "project",
    "words",
    "amplitude",
    "scaled",
    "angles",
    "turned",
    "zoomed",
    "handlers",
    "known",
    "extent",
    "minus",
    "put_in",
    "main",
    "stride",
    "count",
    "panels",
    "panelOf",
    "response",
    "memory",
    "shapes",
    "moved",
    "sortable",
    "filtered",
    "padded",
    "decode",
    "drawn",
    "decimals",
];

/// Returns an equivalent script with fewer characters.
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
                if !(c.is_whitespace() && is_idle(c, out.chars().last(), text.get(at + 1).copied()))
                {
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
            let letter = |n: usize| char::from(b'a' + n as u8);
            if at < 26 {
                format!("${}", letter(at))
            } else {
                format!("${}{}", letter(at / 26), letter(at % 26))
            }
        }
        None if word == "const" => "let".to_owned(),
        None => word.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strings_and_templates_stay_and_words_are_not_joined() {
        let script = "// A comment.\nconst frame = {a: \"frame = a\"};\n  return frame + +1, `frame ${frame.x + 1} {` in b;\n";
        let f = short("frame");
        assert_eq!(
            squeeze(script),
            format!("let {f}={{a:\"frame = a\"}};return {f}+ +1,`frame ${{{f}.x+1}} {{`in b;")
        );
    }
}
