# What the report shows, and where: workflow/report/ has the contents, captions and front page.
CONTENTS = load_yaml(Path(workflow.basedir) / "workflow/report/contents.yaml")

AS_SHOWN = {"tables": "all materials"}


def place(item):
    """Question and title of a figure or page; one without a place in the contents is refused."""
    for question, titles in CONTENTS.items():
        if item in titles:
            return question, titles[item]
    raise KeyError(f"'{item}' has no place in workflow/report/contents.yaml")


def shown(folder, pattern, caption):
    """Show in the report what of a folder matches the pattern, each file's stem an {item}."""
    return report(
        folder,
        patterns=[pattern],
        caption=f"../report/{caption}",
        category=lambda wildcards: place(wildcards.item)[0],
        subcategory=lambda wildcards: AS_SHOWN.get(
            wildcards.material, wildcards.material
        ),
        labels=lambda wildcards: {"result": place(wildcards.item)[1]},
    )
