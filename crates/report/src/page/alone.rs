//! Pages of figures without an identification.

use maud::{DOCTYPE, html};
use mechid_plot::{Figure, matrix_of_squares};

use super::figures::{Drawn, drawn_large};
use super::{PageSettings, about, figure, figure_script, head, repeat};
use crate::ReportError;
use crate::figures::shapes::ModeShapes;

/// Caption of the mode shapes.
pub(super) const SHAPES: &str = "Mode shapes: the structure at its largest deflection, drawn over the structure at rest. In a complex mode \
                                 the points reach their largest deflections at different times.";

/// Caption of the modal assurance criterion.
pub(super) const ASSURANCE_CAPTION: &str = "Similarity of the mode shapes (modal assurance criterion): 1 for the same shape, \
                                   0 for orthogonal ones.";

/// Returns a page of named figures and, if there are any, of mode shapes, as HTML that loads no
/// other file and runs only the script of its figures. If there are several figures, the page
/// offers a choice. The settings give its heading, details and command.
///
/// # Errors
/// [`ReportError::Plot`] if there is no figure, or if a figure cannot be drawn.
pub fn figure_page(
    figures: Vec<(String, Figure)>,
    shapes: Option<&ModeShapes>,
    settings: &PageSettings,
) -> Result<String, ReportError> {
    let figures = figures.into_iter().map(|(name, figure)| (name, figure.titled(""))).collect();
    let mut drawn = vec![drawn_large("figure".into(), figures, String::new())?];
    if let Some(shapes) = shapes {
        drawn.extend(shape_figures(shapes));
    }
    let title = settings.title.as_deref().filter(|title| !title.is_empty()).unwrap_or("Figure");
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (head(title))
            body {
                header { h1 { (title) } (about(&settings.about)) }
                main {
                    @for one in &drawn { (figure(one)) }
                    (repeat(settings.command.as_deref()))
                }
                (figure_script())
            }
        }
    };
    Ok(page.into_string() + "\n")
}

/// Returns the deflected lines and the modal assurance criterion of the shapes.
pub(super) fn shape_figures(shapes: &ModeShapes) -> [Drawn; 2] {
    let drawn = shapes.draw(SHAPES);
    let matrix = matrix_of_squares(&shapes.assurance(), ASSURANCE_CAPTION);
    [
        Drawn {
            id: "shapes".into(),
            svg: drawn.svg,
            map: drawn.map,
            caption: SHAPES.into(),
            is_wide: false,
        },
        Drawn {
            id: "assurance".into(),
            svg: matrix,
            map: Vec::new(),
            caption: ASSURANCE_CAPTION.into(),
            is_wide: false,
        },
    ]
}
