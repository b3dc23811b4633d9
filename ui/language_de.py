"""German.

Terms are those of Blender's own German interface and of photographers. A text that Blender has in German
already, such as *Focus Distance*, is shown in Blender's words and not in ours. Artists are not addressed:
what they can do stands in the infinitive.
"""

from __future__ import annotations

GERMAN: dict[str, str] = {
    # Panels.
    "Potmesil": "Potmesil",
    "Potmesil Camera": "Potmesil Camera",
    "Focus": "Fokus",
    "Aperture": "Blende",
    "Shutter": "Verschluss",
    "Shutter Curve": "Verschlusskurve",
    "Quality": "Qualität",
    "Optical Printer": "Optische Kopiermaschine",
    "Inspect": "Prüfen",
    "Pre-Flight": "Vorabprüfung",
    "Focus Plane": "Fokusebene",
    "Potmesil Stage": "Potmesil-Stufe",
    # Labels.
    "Not the Scene's Active Camera": "Nicht die aktive Kamera der Szene",
    "The Scene Has No Camera": "Die Szene hat keine Kamera",
    "The Lens Takes One Unit for One Metre": "Das Objektiv nimmt eine Einheit als einen Meter",
    "Ready to Render": "Bereit zum Rendern",
    "Blades": "Lamellen",
    "Rotation": "Drehung",
    "Ratio": "Verhältnis",
    "Focus on Object": "Fokus auf Objekt",
    "Focus Bone": "Fokus-Knochen",
    "Focus Distance": "Fokusdistanz",
    "Focal Length": "Brennweite",
    "F-Stop": "Blendenzahl",
    "Position": "Position",
    "Rolling": "Rolling Shutter",
    "Line Time": "Zeilenzeit",
    "Near Limit": "Nahgrenze",
    "Far Limit": "Ferngrenze",
    "Hyperfocal": "Hyperfokaldistanz",
    "Focused At": "Fokussiert auf",
    "Infinity": "Unendlich",
    "Near": "Nah",
    "Sharp": "Scharf",
    "Far": "Fern",
    "Before": "Davor",
    "After": "Danach",
    "Show": "Anzeigen",
    "{width:.3g} px wide": "{width:.3g} px breit",
    "Guessed: {share:.1f} % of the Pixels": "Geschätzt: {share:.1f} % der Pixel",
    "Expected Error: {share:.1f} % of White": "Erwarteter Fehler: {share:.1f} % von Weiß",
    # What goes on.
    "Working": "In Arbeit",
    "{progress}, Esc to Cancel": "{progress}, Esc bricht ab",
    "Potmesil Camera: {progress}, Esc to Cancel": "Potmesil Camera: {progress}, Esc bricht ab",
    "{done}, {time} Remaining": "{done}, noch {time}",
    "Following What Moves in Frame {frame}": "Bewegungen in Bild {frame} verfolgen",
    "Rendering Frame {frame}": "Bild {frame} rendern",
    "Rendering Frame {frame}, View {number} of {count}": "Bild {frame} rendern, Ansicht {number} von {count}",
    "Probing Mirrors and Glass of Frame {frame}": "Spiegel und Glas in Bild {frame} sondieren",
    "Processing Frame {frame}": "Bild {frame} verarbeiten",
    "Compositing Frame {frame}": "Compositing von Bild {frame}",
    "Compositing All Frames": "Compositing aller Bilder",
    "Potmesil Camera is working already": "Potmesil Camera arbeitet bereits",
    "Cancelled": "Abgebrochen",
    "Starting": "Startet",
    "Compiling Kernels (Once)": "Rechenkerne werden übersetzt (einmalig)",
    # Render, Process, animations.
    "Render": "Rendern",
    "Render the current frame without blur, save its samples, and focus them": (
        "Das aktuelle Bild ohne Unschärfe rendern, seine Abtastwerte speichern und sie fokussieren"
    ),
    "Process": "Verarbeiten",
    "Blur the last rendered samples with the present focus, f-stop and shutter, without rendering again": (
        "Die zuletzt gerenderten Abtastwerte mit den jetzigen Werten von Fokus, Blende und Verschluss "
        "unscharf zeichnen, ohne neu zu rendern"
    ),
    "Render Animation": "Animation rendern",
    "Render all frames without blur, save their samples, and blur and write each picture": (
        "Alle Bilder ohne Unschärfe rendern, ihre Abtastwerte speichern, jedes unscharf zeichnen und "
        "schreiben"
    ),
    "Process Animation": "Animation verarbeiten",
    "Blur the rendered samples of all frames with the present settings, and write each picture": (
        "Die gerenderten Abtastwerte aller Bilder mit den jetzigen Einstellungen unscharf zeichnen und jedes "
        "Bild schreiben"
    ),
    "Watch Render": "Rendern beobachten",
    "Notice that ESC ends a render, whose own operator tells nobody": (
        "Bemerken, dass Esc ein Rendern beendet, was dessen eigener Operator niemandem mitteilt"
    ),
    "Set Up Passes": "Durchgänge einrichten",
    "Enable the passes that depth of field and motion blur are made from": (
        "Die Durchgänge einschalten, aus denen Schärfentiefe und Bewegungsunschärfe entstehen"
    ),
    "Object Indices": "Objekt-Indizes",
    "Give every object a pass index of its own; indices that are unique already stay": (
        "Jedem Objekt einen eigenen Durchgangsindex geben; Indizes, die es nur einmal gibt, bleiben"
    ),
    "Passes enabled": "Durchgänge eingeschaltet",
    "Passes enabled, {count} objects given an index of their own": (
        "Durchgänge eingeschaltet, {count} Objekte haben einen eigenen Index erhalten"
    ),
    # The compositor.
    "Composite": "Komposition",
    "Run the compositor on the rendered samples with the present settings, without rendering again": (
        "Den Kompositor mit den jetzigen Einstellungen auf die gerenderten Abtastwerte anwenden, ohne neu zu "
        "rendern"
    ),
    "Composite Animation": "Animation komponieren",
    "Composite the rendered samples of all frames, and write them, without rendering again": (
        "Den Kompositor auf die gerenderten Abtastwerte aller Bilder anwenden und diese schreiben, ohne neu "
        "zu rendern"
    ),
    "Animation": "Animation",
    "Composite the samples of all frames, and write them as Render Animation does": (
        "Den Kompositor auf die Abtastwerte aller Bilder anwenden und diese schreiben, wie „Animation "
        "rendern“ es tut"
    ),
    "Add Stage": "Stufe hinzufügen",
    "Put the processed picture where the compositor's Render Layers nodes are, or update its passes": (
        "Das verarbeitete Bild an die Stelle der Knoten „Render-Ebenen“ im Kompositor setzen, oder seine "
        "Durchgänge aktualisieren"
    ),
    "Update Stage": "Stufe aktualisieren",
    "Remove Stage": "Stufe entfernen",
    "Put the compositor back to how it was without the stage": (
        "Den Kompositor in den Zustand ohne die Stufe zurückversetzen"
    ),
    "Stage Of": "Stufe von",
    "The scene whose processed picture this one hands to the compositor": (
        "Die Szene, deren verarbeitetes Bild diese an den Kompositor weitergibt"
    ),
    "A compositor tree was made, with the stage in it": "Ein Knotenbaum mit der Stufe wurde angelegt",
    "The stage stands in the place of 1 Render Layers node": (
        "Die Stufe steht an der Stelle eines Knotens „Render-Ebenen“"
    ),
    "The stage stands in the place of {count} Render Layers nodes": (
        "Die Stufe steht an der Stelle von {count} Knoten „Render-Ebenen“"
    ),
    "The stage was there; its passes are up to date": (
        "Die Stufe war schon da; ihre Durchgänge sind auf dem neuesten Stand"
    ),
    "The compositor has no stage; press Add Stage": (
        "Der Kompositor hat keine Stufe; „Stufe hinzufügen“ drücken"
    ),
    "The compositor has no stage; press Add Stage.": (
        "Der Kompositor hat keine Stufe; „Stufe hinzufügen“ drücken."
    ),
    "The scene has no stage.": "Die Szene hat keine Stufe.",
    "The Render Layers node '{name}' is not part of the stage; press Add Stage, or mute it.": (
        "Der Knoten „Render-Ebenen“ namens '{name}' gehört nicht zur Stufe; „Stufe hinzufügen“ drücken oder "
        "den Knoten stummschalten."
    ),
    "The compositor has no Render Layers node of this scene; add one first.": (
        "Der Kompositor hat keinen Knoten „Render-Ebenen“ dieser Szene; zuerst einen hinzufügen."
    ),
    "'{name}' is a stage's own scene; go to the scene that it belongs to.": (
        "'{name}' ist die eigene Szene einer Stufe; zu der Szene wechseln, zu der sie gehört."
    ),
    "The compositor tree '{name}' is linked from another file; make it local first.": (
        "Der Knotenbaum '{name}' ist aus einer anderen Datei verknüpft; ihn zuerst lokal machen."
    ),
    "The compositor tree '{name}' is shared with the scene '{other}'; make it a single-user copy first.": (
        "Den Knotenbaum '{name}' benutzt auch die Szene '{other}'; zuerst eine eigene Kopie anlegen."
    ),
    "The stage failed; the console has the details ({kind}: {error}).": (
        "Die Stufe ist gescheitert; Einzelheiten stehen in der Konsole ({kind}: {error})."
    ),
    (
        "The samples are for {columns} x {rows} pixels and the render has {render_columns} x {render_rows}; "
        "render again."
    ): (
        "Die Abtastwerte sind für {columns} x {rows} Pixel, und gerendert werden {render_columns} x "
        "{render_rows}; neu rendern."
    ),
    (
        "Only the scene that a stage belongs to can show it; render that scene, or remove the stage's nodes "
        "from this one's compositor."
    ): (
        "Nur die Szene, zu der eine Stufe gehört, kann sie zeigen; jene Szene rendern oder die Knoten der "
        "Stufe aus dem Kompositor dieser Szene entfernen."
    ),
    # Live Focus.
    "Live Focus": "Live-Fokus",
    "Let the result follow focus, aperture and shutter while they change; hold and drag in it to focus": (
        "Das Ergebnis folgt Fokus, Blende und Verschluss, während sie sich ändern; zum Fokussieren darin bei "
        "gedrückter Maustaste ziehen"
    ),
    "Cancel Live Focus": "Live-Fokus abbrechen",
    "End Live Focus with the settings as they were when it began": (
        "Live-Fokus beenden, mit den Einstellungen wie zu seinem Beginn"
    ),
    "Confirm": "Bestätigen",
    "Cancel": "Abbrechen",
    "Live Focus: Drag in the Image to Focus, Enter to Confirm, Esc to Cancel": (
        "Live-Fokus: Ziehen im Bild fokussiert, Enter bestätigt, Esc bricht ab"
    ),
    "There is nothing at this place to focus on.": (
        "An dieser Stelle ist nichts, worauf fokussiert werden kann."
    ),
    "A driver sets the focus distance; remove it to focus by hand.": (
        "Ein Treiber bestimmt die Fokusdistanz; ihn entfernen, um von Hand zu fokussieren."
    ),
    "The camera is linked from another file; make it local to focus by hand.": (
        "Die Kamera ist aus einer anderen Datei verknüpft; sie lokal machen, um von Hand zu fokussieren."
    ),
    "{name} is no longer the focus object: the mouse sets the distance.": (
        "{name} ist nicht mehr das Fokusobjekt: Die Maus bestimmt die Distanz."
    ),
    "Frame {frame} has no samples yet; press Render to make them.": (
        "Bild {frame} hat noch keine Abtastwerte; „Rendern“ drücken, um sie zu erzeugen."
    ),
    "Live Focus does not start on this computer; use Process instead.": (
        "Live-Fokus startet auf diesem Rechner nicht; stattdessen „Verarbeiten“ verwenden."
    ),
    "Live Focus does not start: {reason}; use Process instead.": (
        "Live-Fokus startet nicht: {reason}; stattdessen „Verarbeiten“ verwenden."
    ),
    "Blender's Python is not found; use Process instead of Live Focus.": (
        "Blenders Python ist nicht zu finden; „Verarbeiten“ statt „Live-Fokus“ verwenden."
    ),
    # Inspect Focus.
    "Inspect Focus": "Fokus prüfen",
    (
        "Show over the result what is near, sharp and far, what the lens does under the mouse, and the "
        "render before it"
    ): (
        "Über dem Ergebnis zeigen, was nah, scharf und fern ist, was das Objektiv unter der Maus tut, und "
        "das Bild vor dem Objektiv"
    ),
    "Follow the mouse in one window while Inspect Focus is on": (
        "Der Maus in einem Fenster folgen, solange „Fokus prüfen“ eingeschaltet ist"
    ),
    "Overlay": "Überlagern",
    "Colour what is near, sharp and far by the limits of the depth of field": (
        "Einfärben, was nach den Grenzen der Schärfentiefe nah, scharf und fern ist"
    ),
    "Read-Out": "Messwerte",
    "Show the distance and the circle of confusion of what is under the mouse": (
        "Distanz und Zerstreuungskreis dessen anzeigen, was unter der Maus ist"
    ),
    "PSF": "PSF",
    "Draw the point-spread function under the mouse: what becomes of a point there": (
        "Die Punktspreizfunktion unter der Maus zeichnen: was aus einem Punkt dort wird"
    ),
    "Compare": "Vergleichen",
    ("Show the render as it is before the lens and the shutter to the left of a line that can be dragged"): (
        "Links einer Linie, die sich ziehen lässt, das gerenderte Bild zeigen, wie es vor Objektiv und "
        "Verschluss ist"
    ),
    "Split": "Teilen",
    "Share of the picture to the left of the line, which shows the render before": (
        "Anteil des Bildes links der Linie, der das gerenderte Bild vorher zeigt"
    ),
    "Depth of field is off: the result is sharp everywhere.": (
        "Schärfentiefe ist ausgeschaltet: Das Ergebnis ist überall scharf."
    ),
    "There is no result yet; press Render to make one.": (
        "Es gibt noch kein Ergebnis; „Rendern“ drücken, um eines zu erzeugen."
    ),
    "The render cannot be compared: {reason}": "Das gerenderte Bild lässt sich nicht vergleichen: {reason}",
    # Focus in the viewport.
    "Focus on Active Object": "Auf aktives Objekt fokussieren",
    "Set the focus distance of the scene's camera to the active object, where it is now": (
        "Die Fokusdistanz der Kamera der Szene auf das aktive Objekt setzen, wo es jetzt ist"
    ),
    "Focus On": "Fokus auf",
    "What of the object is in focus": "Was vom Objekt im Fokus liegt",
    "Origin": "Ursprung",
    "The object's origin, or the active bone in Pose Mode": (
        "Der Ursprung des Objekts, oder im Posenmodus der aktive Knochen"
    ),
    "Nearest Surface": "Nächste Oberfläche",
    (
        "The first of its surface on the line from the camera to its origin, or, where that misses it, the "
        "nearest"
    ): (
        "Das erste Stück seiner Oberfläche auf der Linie von der Kamera zum Ursprung oder, wo diese sie "
        "verfehlt, das nächste"
    ),
    "Track Active Object": "Aktives Objekt verfolgen",
    "Keep the active object, or the active bone in Pose Mode, in focus wherever it goes": (
        "Das aktive Objekt, oder im Posenmodus den aktiven Knochen, im Fokus halten, wohin es auch geht"
    ),
    "Stop Tracking": "Verfolgen beenden",
    "Leave the focus at the distance where the tracked object is now": (
        "Den Fokus bei der Distanz lassen, in der das verfolgte Objekt jetzt ist"
    ),
    "Show Limits": "Grenzen anzeigen",
    (
        "Show the near limit, the plane in focus with a handle, and the far limit of the scene's camera in "
        "the 3D viewports"
    ): (
        "Nahgrenze, Fokusebene mit einem Griff und Ferngrenze der Kamera der Szene in den 3D-Ansichten "
        "anzeigen"
    ),
    "The scene has no camera": "Die Szene hat keine Kamera",
    "There is no active object": "Es gibt kein aktives Objekt",
    "The active object is the camera itself; select one other object with it": (
        "Das aktive Objekt ist die Kamera selbst; dazu genau ein anderes Objekt auswählen"
    ),
    "The camera tracks no object": "Die Kamera verfolgt kein Objekt",
    "The focus distance takes no key; unlock its curve or turn Auto Keying off.": (
        "Die Fokusdistanz nimmt kein Schlüsselbild an; ihre Kurve entsperren oder automatische "
        "Schlüsselbilder ausschalten."
    ),
    "The focus distance is animated: insert a key to keep it.": (
        "Die Fokusdistanz ist animiert: ein Schlüsselbild einfügen, damit sie bleibt."
    ),
    "{name} is no longer tracked.": "{name} wird nicht mehr verfolgt.",
    "{name} is not before the camera.": "{name} ist nicht vor der Kamera.",
    "{name} has no surface; its origin is in focus.": (
        "{name} hat keine Oberfläche; der Ursprung liegt im Fokus."
    ),
    "Focused on {name} at {distance}": "Fokussiert auf {name} bei {distance}",
    # Presets.
    "Lens and Film Presets": "Voreinstellungen für Objektiv und Film",
    "Add Lens and Film Preset": "Voreinstellung für Objektiv und Film hinzufügen",
    "Add or remove a preset of lens, film and iris": (
        "Eine Voreinstellung für Objektiv, Film und Irisblende hinzufügen oder entfernen"
    ),
    "Shutter Presets": "Voreinstellungen für den Verschluss",
    "Add Shutter Preset": "Voreinstellung für den Verschluss hinzufügen",
    "Add or remove a preset of the shutter": (
        "Eine Voreinstellung für den Verschluss hinzufügen oder entfernen"
    ),
    # Lens and aperture.
    "Depth of Field": "Schärfentiefe",
    "Run the focus processor on the samples": "Den Fokusprozessor auf die Abtastwerte anwenden",
    "Circle of Confusion": "Zerstreuungskreis",
    "How points out of focus are imaged": "Wie Punkte außerhalb des Fokus abgebildet werden",
    "Match Cycles": "Wie Cycles",
    "The field of view stays while the lens focuses, as in Cycles": (
        "Der Bildwinkel bleibt beim Fokussieren gleich, wie in Cycles"
    ),
    "Lens Law": "Linsengleichung",
    "The lens moves to focus, as a real one does and as in the papers": (
        "Das Objektiv bewegt sich beim Fokussieren, wie ein wirkliches und wie in den Veröffentlichungen"
    ),
    "Aperture Image": "Blendenbild",
    "What a point out of focus becomes": "Was aus einem Punkt außerhalb des Fokus wird",
    "Geometric": "Geometrisch",
    "The aperture's shape, evenly lit, with its blades and squeeze": (
        "Die Form der Blende, gleichmäßig hell, mit ihren Lamellen und ihrer Stauchung"
    ),
    "Diffraction": "Beugung",
    "The diffraction pattern of a round aperture at three wavelengths": (
        "Das Beugungsmuster einer runden Blende bei drei Wellenlängen"
    ),
    "Visibility": "Sichtbarkeit",
    "What the lens sees of things behind others": "Was das Objektiv von Dingen hinter anderen sieht",
    "Near things hide what is behind them from a part of the aperture, as with a real lens": (
        "Nahe Dinge verdecken das, was hinter ihnen liegt, vor einem Teil der Blende, wie bei einem "
        "wirklichen Objektiv"
    ),
    "None (Papers)": "Keine (Veröffentlichungen)",
    (
        "The light of all things is added, as in the papers: faster, but blurred backgrounds spread over "
        "what is before them"
    ): (
        "Das Licht aller Dinge wird addiert, wie in den Veröffentlichungen: schneller, aber unscharfe "
        "Hintergründe breiten sich über das aus, was vor ihnen liegt"
    ),
    # Presets of the special effects.
    "Lens Presets": "Voreinstellungen für das Objektiv",
    "Add Lens Preset": "Voreinstellung für das Objektiv hinzufügen",
    "Add or remove a preset of the lens's character": (
        "Eine Voreinstellung für den Charakter des Objektivs hinzufügen oder entfernen"
    ),
    "Filter and Film Presets": "Voreinstellungen für Filter und Film",
    "Add Filter and Film Preset": "Voreinstellung für Filter und Film hinzufügen",
    "Add or remove a preset of filters, film and sensor": (
        "Eine Voreinstellung für Filter, Film und Sensor hinzufügen oder entfernen"
    ),
    # The lens's character.
    "Special Effects": "Spezialeffekte",
    "What a real lens, filters, film and sensor add to the picture": (
        "Was ein wirkliches Objektiv, Filter, Film und Sensor dem Bild hinzufügen"
    ),
    "Lens Character": "Objektivcharakter",
    "Aperture Shape": "Blendenform",
    "Give the light of points out of focus the shape of a real aperture": (
        "Dem Licht unscharfer Punkte die Form einer wirklichen Blende geben"
    ),
    "Blade Curvature": "Lamellenform",
    "How far the blades are bent, from straight to a round aperture": (
        "Wie stark die Lamellen gebogen sind, von gerade bis zu einer runden Blende"
    ),
    "Obstruction": "Abschattung",
    (
        "Diameter of a mirror lens's secondary mirror, as a share of the aperture's: lights out of focus "
        "become rings"
    ): (
        "Durchmesser des Fangspiegels eines Spiegelobjektivs als Anteil an dem der Blende: Unscharfe "
        "Lichter werden zu Ringen"
    ),
    "Apodisation": "Apodisation",
    (
        "Density of a filter in the aperture that darkens towards the rim, so that lights out of focus "
        "have soft edges"
    ): (
        "Dichte eines Filters in der Blende, der zum Rand hin dunkler wird, so dass unscharfe Lichter "
        "weiche Ränder haben"
    ),
    "Spherical Aberration": "Sphärische Aberration",
    "Spherical": "Sphärisch",
    (
        "How far behind the focus of rays near the axis those through the rim meet at f/1: positive gives "
        "soft rims before and hard rims behind the plane in focus, negative the reverse"
    ): (
        "Wie weit hinter dem Brennpunkt achsnaher Strahlen sich bei f/1 die vom Rand treffen: Positiv gibt "
        "weiche Ränder vor und harte hinter der Fokusebene, negativ umgekehrt"
    ),
    "A picture of the aperture, white where light passes, in place of blades and obstruction": (
        "Ein Bild der Blende, weiß, wo Licht hindurchgeht, an Stelle von Lamellen und Abschattung"
    ),
    "Diffraction as Aperture Image is for a round and clear aperture only; choose Geometric.": (
        "Beugung als Blendenbild gibt es nur für eine runde und freie Blende; „Geometrisch“ wählen."
    ),
    "Focal Surface": "Schärfefläche",
    "Tilt the plane in focus as a view camera does, or bend it": (
        "Die Fokusebene kippen, wie eine Fachkamera es tut, oder sie biegen"
    ),
    "Tilt": "Neigung",
    "Angle that the lens is tilted up by: what is above is sharp nearer by": (
        "Winkel, um den das Objektiv nach oben geneigt ist: Was oben ist, ist näher an der Kamera scharf"
    ),
    "Swing": "Schwenkung",
    "Angle that the lens is swung to the right by: what is right is sharp nearer by": (
        "Winkel, um den das Objektiv nach rechts geschwenkt ist: Was rechts ist, ist näher an der Kamera "
        "scharf"
    ),
    "Hinge At": "Drehachse bei",
    "Curvature": "Wölbung",
    (
        "One over the radius, in metres, of the surface that the lens images sharply onto: with positive "
        "ones the border is sharp nearer by than the middle"
    ): (
        "Eins durch den Radius in Metern der Fläche, auf die das Objektiv scharf abbildet: Mit positiven "
        "Werten ist der Rand näher an der Kamera scharf als die Mitte"
    ),
    "Chromatic Aberration": "Chromatische Aberration",
    "Focus the colours at other distances, or image them at other sizes, as simple lenses do": (
        "Die Farben in anderen Entfernungen fokussieren oder in anderer Größe abbilden, wie einfache "
        "Linsen es tun"
    ),
    "Focus Red": "Fokus Rot",
    "Focus Blue": "Fokus Blau",
    "Size Red": "Größe Rot",
    "Size Blue": "Größe Blau",
    "Blue": "Blau",
    "How far behind green's focus on the film side red's lies: what is out of focus has coloured rims": (
        "Wie weit auf der Filmseite der Fokus von Rot hinter dem von Grün liegt: Unscharfes hat farbige "
        "Ränder"
    ),
    "How far behind green's focus on the film side blue's lies: what is out of focus has coloured rims": (
        "Wie weit auf der Filmseite der Fokus von Blau hinter dem von Grün liegt: Unscharfes hat farbige "
        "Ränder"
    ),
    "Share by which red's picture is larger than green's: edges towards the corners have coloured fringes": (
        "Anteil, um den das Bild in Rot größer ist als das in Grün: Kanten zu den Ecken hin haben Farbsäume"
    ),
    "Share by which blue's picture is larger than green's: edges towards the corners have coloured fringes": (
        "Anteil, um den das Bild in Blau größer ist als das in Grün: Kanten zu den Ecken hin haben Farbsäume"
    ),
    "Vignetting": "Vignettierung",
    "Darken the corners, and cut lights out of focus there to cat's eyes": (
        "Die Ecken abdunkeln und unscharfe Lichter dort zu Katzenaugen beschneiden"
    ),
    "Natural": "Natürlich",
    (
        "Share of the fall of light with the fourth power of the cosine of its angle, which a simple lens "
        "has in full"
    ): (
        "Anteil am Lichtabfall mit der vierten Potenz des Kosinus des Winkels, den eine einfache Linse "
        "ganz hat"
    ),
    "Cat's Eye": "Katzenauge",
    (
        "How far apart the two ends of the lens's barrel are seen from the corners, in diameters of the "
        "aperture"
    ): (
        "Wie weit die beiden Enden der Fassung von den Ecken aus gesehen auseinander liegen, in Durchmessern "
        "der Blende"
    ),
    "Fastest F-Stop": "Größte Öffnung",
    (
        "F-stop at which the aperture is as wide as the barrel: stopped down from there, cat's eyes go. 0 "
        "is the present one"
    ): (
        "Blendenzahl, bei der die Blende so weit ist wie die Fassung: Abgeblendet verschwinden die "
        "Katzenaugen. 0 ist die jetzige"
    ),
    "Distortion": "Verzeichnung",
    "Bend straight lines to a barrel or a pincushion, by the formulas of movie clips": (
        "Gerade Linien tonnen- oder kissenförmig biegen, nach den Formeln der Filmclips"
    ),
    "Clip": "Clip",
    "Movie clip whose solved camera says how lines are bent, in place of the numbers below": (
        "Filmclip, dessen berechnete Kamera sagt, wie Linien gebogen werden, an Stelle der Zahlen darunter"
    ),
    "Model": "Modell",
    "Formula of the movie clip editor": "Formel des Filmclip-Editors",
    "Brown": "Brown",
    "Radial and tangential terms by Brown and Conrady": (
        "Radiale und tangentiale Glieder nach Brown und Conrady"
    ),
    "Polynomial": "Polynom",
    "Radial terms, which fit common cameras": "Radiale Glieder, die zu üblichen Kameras passen",
    "Division": "Division",
    "One over a polynomial, which fits wide-angle lenses better": (
        "Eins durch ein Polynom, was besser zu Weitwinkeln passt"
    ),
    "Nuke": "Nuke",
    "The terms of Nuke's lens distortion": "Die Glieder der Objektivverzeichnung von Nuke",
    "K1": "K1",
    "K2": "K2",
    "K3": "K3",
    "K4": "K4",
    "P1": "P1",
    "P2": "P2",
    (
        "Coefficient of the second power of the radius; with Brown, below 0 is a barrel and above 0 a "
        "pincushion"
    ): ("Koeffizient der zweiten Potenz des Radius; bei Brown ist unter 0 eine Tonne und über 0 ein Kissen"),
    "Coefficient of the fourth power of the radius": "Koeffizient der vierten Potenz des Radius",
    "Coefficient of the sixth power of the radius": "Koeffizient der sechsten Potenz des Radius",
    "Coefficient of the eighth power of the radius": "Koeffizient der achten Potenz des Radius",
    "First tangential coefficient, of a lens off its axis": (
        "Erster tangentialer Koeffizient, für eine Linse neben ihrer Achse"
    ),
    "Second tangential coefficient, of a lens off its axis": (
        "Zweiter tangentialer Koeffizient, für eine Linse neben ihrer Achse"
    ),
    # Filters and film.
    "Filters and Film": "Filter und Film",
    (
        "Spread all light by the diffraction pattern of the aperture, which gives bright lights the stars "
        "of a lens stopped down"
    ): (
        "Alles Licht nach dem Beugungsmuster der Blende ausbreiten, was hellen Lichtern die Sterne eines "
        "abgeblendeten Objektivs gibt"
    ),
    "Strength": "Stärke",
    "Share of the light that is diffracted; 1 is physical": (
        "Anteil des Lichts, der gebeugt wird; 1 ist physikalisch"
    ),
    "F-stop of the pattern in place of the lens's; 0 is the lens's": (
        "Blendenzahl des Musters an Stelle der des Objektivs; 0 ist die des Objektivs"
    ),
    "Full Spectrum": "Vollspektrum",
    (
        "Let all wavelengths make the pattern, which gives its streaks the colours of a rainbow, and not "
        "only one for each of red, green and blue"
    ): (
        "Das Muster aus allen Wellenlängen bilden, was seinen Strahlen die Farben des Regenbogens gibt, "
        "und nicht nur aus je einer für Rot, Grün und Blau"
    ),
    "Star Filter": "Sternfilter",
    "Put glass with fine parallel grooves before the lens, which draw lights out to streaks": (
        "Ein Glas mit feinen parallelen Rillen vor das Objektiv setzen, die Lichter zu Strahlen ausziehen"
    ),
    "Directions": "Richtungen",
    "Directions of the grooves, each of which gives a star two points": (
        "Richtungen der Rillen, deren jede einem Stern zwei Zacken gibt"
    ),
    "Star Points": "Zacken",
    "Angle of the first streak, counter-clockwise from level": (
        "Winkel des ersten Strahls, gegen den Uhrzeigersinn von der Waagerechten"
    ),
    "Share of the light that falls on grooves": "Anteil des Lichts, der auf Rillen fällt",
    "Width (µm)": "Breite (µm)",
    "Width of a groove: the narrower, the longer the streaks": (
        "Breite einer Rille: je schmaler, desto länger die Strahlen"
    ),
    "Image Filter": "Bildfilter",
    "Give a share of all light the form of a picture, such as a glare that was photographed": (
        "Einem Anteil allen Lichts die Form eines Bildes geben, etwa einer fotografierten Blendung"
    ),
    "Picture": "Bild",
    "What a point of light becomes; the picture's middle is the point's place": (
        "Was aus einem Lichtpunkt wird; die Mitte des Bildes ist der Ort des Punktes"
    ),
    "Choose a picture first.": "Zuerst ein Bild wählen.",
    "Share of the light that takes the picture's form": "Anteil des Lichts, der die Form des Bildes annimmt",
    "Size": "Größe",
    "Width of the picture as a share of the frame's": "Breite des Bildes als Anteil an der des ganzen",
    "Angle that the picture is turned by, counter-clockwise": (
        "Winkel, um den das Bild gegen den Uhrzeigersinn gedreht wird"
    ),
    "Exposure": "Belichtung",
    "Let film speed, f-stop and shutter time brighten and darken the picture as in a real camera": (
        "Filmempfindlichkeit, Blendenzahl und Verschlusszeit hellen das Bild auf und dunkeln es ab wie in "
        "einer wirklichen Kamera"
    ),
    "ISO": "ISO",
    "Speed of the film or the sensor: twice the number is one stop brighter": (
        "Empfindlichkeit des Films oder des Sensors: Die doppelte Zahl ist eine Blendenstufe heller"
    ),
    "Normal EV": "Normaler LW",
    (
        "Exposure value at ISO 100 that leaves the picture as it was rendered: that of the light that the "
        "scene stands for, such as 15 in the sun"
    ): (
        "Lichtwert bei ISO 100, der das Bild lässt, wie es gerendert wurde: der des Lichts, für das die "
        "Szene steht, etwa 15 in der Sonne"
    ),
    "ND Filter": "Graufilter",
    "How much a grey filter before the lens darkens the picture, in stops": (
        "Wie viel ein Graufilter vor dem Objektiv das Bild abdunkelt, in Blendenstufen"
    ),
    "Filter Color": "Filterfarbe",
    "Share of red, green and blue light that a coloured filter before the lens lets through": (
        "Anteil an rotem, grünem und blauem Licht, den ein Farbfilter vor dem Objektiv durchlässt"
    ),
    "Brightness": "Helligkeit",
    "{stops:+.1f} Stops": "{stops:+.1f} Blendenstufen",
    "Film Grain": "Filmkorn",
    "Give the picture the grain of a film, by the granularity on its data sheet": (
        "Dem Bild das Korn eines Films geben, nach der Körnigkeit auf seinem Datenblatt"
    ),
    "Granularity": "Körnigkeit",
    (
        "RMS granularity of film data sheets: 1000 times the deviation of density seen through a hole of "
        "48 µm. About 5 is very fine, 10 fine, 20 coarse"
    ): (
        "RMS-Körnigkeit der Datenblätter von Filmen: das Tausendfache der Streuung der Dichte, durch ein "
        "Loch von 48 µm gesehen. Etwa 5 ist sehr fein, 10 fein, 20 grob"
    ),
    "Size (µm)": "Größe (µm)",
    "Diameter of a grain or dye cloud on the film": (
        "Durchmesser eines Korns oder einer Farbstoffwolke auf dem Film"
    ),
    "Color": "Farbe",
    (
        "How different the grain of red, green and blue is: 0 for black-and-white film, 1 for three layers "
        "apart"
    ): (
        "Wie verschieden das Korn von Rot, Grün und Blau ist: 0 für Schwarzweißfilm, 1 für drei getrennte "
        "Schichten"
    ),
    "Seed": "Startwert",
    "Another seed is another piece of film; each frame has its own grain anyway": (
        "Ein anderer Startwert ist ein anderes Stück Film; jedes Bild hat ohnehin sein eigenes Korn"
    ),
    "Sensor Noise": "Sensorrauschen",
    "Count photons as an electronic sensor does, which is noisy where light is scarce": (
        "Photonen zählen, wie ein elektronischer Sensor es tut, was rauscht, wo Licht knapp ist"
    ),
    "Full Well": "Sättigung",
    (
        "Electrons that white at ISO 100 gives a pixel: about 50000 with full frame, 5000 in a phone. The "
        "ISO is that of Exposure"
    ): (
        "Elektronen, die Weiß bei ISO 100 einem Pixel gibt: etwa 50000 bei Kleinbild, 5000 im Telefon. Die "
        "ISO-Zahl ist die der Belichtung"
    ),
    "Read Noise": "Auslesen",
    "Electrons by which reading a pixel out deviates, which is what is left in the dark": (
        "Elektronen, um die das Auslesen eines Pixels streut, was im Dunkeln übrig bleibt"
    ),
    "Another seed is another take; each frame has its own noise anyway": (
        "Ein anderer Startwert ist eine andere Aufnahme; jedes Bild hat ohnehin sein eigenes Rauschen"
    ),
    # The optical printer.
    "Uniform Defocus": "Gleichmäßige Unschärfe",
    (
        "Diameter on the film of the circle that the finished picture is evenly defocused by, whatever the "
        "depth, as in an optical printer"
    ): (
        "Durchmesser auf dem Film des Kreises, um den das fertige Bild unabhängig von der Tiefe gleichmäßig "
        "unscharf wird, wie in einer optischen Kopiermaschine"
    ),
    "Fade": "Abblende",
    "Share of the finished picture's light, from black to all of it": (
        "Anteil vom Licht des fertigen Bildes, von Schwarz bis zu allem"
    ),
    # Motion and shutter.
    "Motion Blur": "Bewegungsunschärfe",
    "Run the motion processor on the samples": "Den Bewegungsprozessor auf die Abtastwerte anwenden",
    "Paths": "Pfade",
    "Which path a sample of a moving object follows": (
        "Welchem Pfad ein Abtastwert eines bewegten Objekts folgt"
    ),
    "Auto": "Auto",
    "One path where all samples of an object move alike, else one for each sample": (
        "Ein Pfad, wo sich alle Abtastwerte eines Objekts gleich bewegen, sonst einer für jeden Abtastwert"
    ),
    "One Path per Object": "Ein Pfad je Objekt",
    "All samples of an object share one path, as in the papers": (
        "Alle Abtastwerte eines Objekts teilen sich einen Pfad, wie in den Veröffentlichungen"
    ),
    "One Path per Sample": "Ein Pfad je Abtastwert",
    "Each sample moves as its object and the camera do, or by its vector where shapes change": (
        "Jeder Abtastwert bewegt sich wie sein Objekt und die Kamera, oder nach seinem Vektor, wo sich "
        "Formen ändern"
    ),
    "Type": "Typ",
    "How the shutter lets light onto the film": "Wie der Verschluss Licht auf den Film lässt",
    "Whole Film": "Ganzer Film",
    "All of the film at once, or line by line with Cycles' rolling shutter": (
        "Der ganze Film auf einmal, oder Zeile für Zeile mit dem Rolling Shutter von Cycles"
    ),
    "Focal Plane": "Schlitzverschluss",
    "A slit travels over the film, so that moving objects are skewed": (
        "Ein Schlitz läuft über den Film, so dass bewegte Objekte verzerrt werden"
    ),
    "Between the Lens": "Zentralverschluss",
    "Blades in the lens open and close the aperture, so that its radius varies with time": (
        "Lamellen im Objektiv öffnen und schließen die Blende, so dass ihr Radius sich mit der Zeit ändert"
    ),
    "Angle": "Winkel",
    "From": "Von",
    "A flash needs all of the film uncovered at once; leave out the slit, or the flash.": (
        "Ein Blitz braucht den ganzen Film auf einmal frei; lassen Sie den Schlitz weg, oder den Blitz."
    ),
    "The shutter's curve is 0 when the flash fires; raise it there.": (
        "Die Kurve des Verschlusses ist 0, wenn der Blitz auslöst; heben Sie sie dort an."
    ),
    "The blades are never open for a flash; shorten their time.": (
        "Die Lamellen sind für einen Blitz nie offen; verkürzen Sie ihre Zeit."
    ),
    "Rotary Disc": "Umlaufblende",
    (
        "A disc with an opening turns once a frame before the gate, whose sides it uncovers one after the "
        "other"
    ): (
        "Eine Scheibe mit einer Öffnung dreht sich einmal je Bild vor dem Bildfenster, dessen Seiten sie "
        "nacheinander freigibt"
    ),
    "Shutter Angle": "Sektorenblende",
    ("Blender's own Shutter as the opening of a disc that turns once a frame; to animate it, key Shutter"): (
        "Blenders eigener Verschluss als Öffnung einer Scheibe, die sich einmal je Bild dreht; animiert wird "
        "er über Verschluss"
    ),
    "Gate Angle": "Fensterwinkel",
    ("Angle of the film gate as seen from the disc's axis: its last side is exposed by so much later"): (
        "Winkel des Bildfensters von der Achse der Scheibe aus: um so viel später wird seine letzte Seite "
        "belichtet"
    ),
    "Flash": "Blitz",
    ("Light the scene with flashes while the shutter is open. Their light falls on everything alike"): (
        "Die Szene mit Blitzen beleuchten, solange der Verschluss offen ist. Ihr Licht fällt auf alles gleich"
    ),
    "Curtain": "Vorhang",
    "With which end of the exposure the flash is in step": (
        "Mit welchem Ende der Belichtung der Blitz zusammenfällt"
    ),
    "First Curtain": "Erster Vorhang",
    "When the shutter has opened: trails run ahead of what moves": (
        "Wenn der Verschluss offen ist: Spuren eilen dem Bewegten voraus"
    ),
    "Second Curtain": "Zweiter Vorhang",
    "Before the shutter closes: trails follow what moves": (
        "Bevor der Verschluss schließt: Spuren folgen dem Bewegten"
    ),
    "Flash Light": "Blitzlicht",
    "Share of the exposure's light that comes from flashes; the rest is ambient": (
        "Anteil des Lichts der Belichtung, der von Blitzen kommt; der Rest ist Umgebungslicht"
    ),
    "Share of Light": "Lichtanteil",
    "Flash Duration": "Blitzdauer",
    "How long a flash lasts, in units of the shutter time": (
        "Wie lange ein Blitz dauert, in Einheiten der Verschlusszeit"
    ),
    "Flashes": "Blitze",
    "More than one is a strobe, evenly over the exposure": (
        "Mehr als einer ist ein Stroboskop, gleichmäßig über die Belichtung"
    ),
    "A slit uncovers a part of the film only: no flash fires.": (
        "Ein Schlitz gibt nur einen Teil des Films frei: kein Blitz wird ausgelöst."
    ),
    "Slit From": "Schlitz von",
    "The side of the picture that the slit exposes first": (
        "Die Seite des Bildes, die der Schlitz zuerst belichtet"
    ),
    "Top": "Oben",
    "From top to bottom": "Von oben nach unten",
    "Bottom": "Unten",
    "From bottom to top": "Von unten nach oben",
    "Left": "Links",
    "From left to right": "Von links nach rechts",
    "Right": "Rechts",
    "From right to left": "Von rechts nach links",
    "Slit Width": "Schlitzbreite",
    "Share of the exposure that a point of the film gets; at 1 the film is exposed at once": (
        "Anteil der Belichtung, den ein Punkt des Films erhält; bei 1 wird der Film auf einmal belichtet"
    ),
    "Blade Time": "Lamellenzeit",
    "Share of the exposure in which the blades open, and again close": (
        "Anteil der Belichtung, in dem die Lamellen sich öffnen und ebenso wieder schließen"
    ),
    "Exposures": "Belichtungen",
    "How often the shutter opens for one picture": "Wie oft sich der Verschluss für ein Bild öffnet",
    "Duration": "Dauer",
    "How long each exposure lasts, in units of the shutter time": (
        "Wie lange jede Belichtung dauert, in Einheiten der Verschlusszeit"
    ),
    "Spacing": "Abstand",
    (
        "From one exposure's begin to the next one's, in units of the shutter time; never less than the "
        "duration"
    ): (
        "Vom Beginn einer Belichtung zum Beginn der nächsten, in Einheiten der Verschlusszeit; nie weniger "
        "als die Dauer"
    ),
    # Quality.
    "Samples": "Abtastwerte",
    "How finely the picture is sampled, by Cycles only": "Wie fein das Bild abgetastet wird, nur von Cycles",
    "Pixels": "Pixel",
    "One sample for each pixel, filtered as in any render": (
        "Ein Abtastwert für jeden Pixel, gefiltert wie sonst beim Rendern"
    ),
    "Fine": "Fein",
    (
        "Twice the size, filtered as always: closest to Cycles. It has four times the pixels; give Cycles a "
        "quarter of the samples"
    ): (
        "Doppelte Größe, gefiltert wie immer: Cycles am nächsten. Das sind viermal so viele Pixel; Cycles "
        "ein Viertel der Abtastwerte geben"
    ),
    "Points": "Punkte",
    (
        "Twice the size with the smallest filter, so that each sample is one point, as in the papers; fine "
        "texture in focus suffers. It has four times the pixels; give Cycles a quarter of the samples"
    ): (
        "Doppelte Größe mit dem kleinsten Filter, so dass jeder Abtastwert ein Punkt ist, wie in den "
        "Veröffentlichungen; feine Texturen im Fokus leiden. Das sind viermal so viele Pixel; Cycles ein "
        "Viertel der Abtastwerte geben"
    ),
    "Overscan": "Overscan",
    (
        "Render a margin around the picture, as wide as things move there during the exposure and as circles "
        "of confusion reach in, so that what comes in from outside is there. It takes longer by the square: "
        "a margin of a tenth of the picture on each side by almost a half"
    ): (
        "Einen Rand um das Bild mitrendern, so breit, wie sich Dinge dort während der Belichtung bewegen und "
        "Zerstreuungskreise hineinreichen, damit da ist, was von außen hereinkommt. Es dauert im Quadrat "
        "länger: bei einem Rand von einem Zehntel des Bildes auf jeder Seite fast um die Hälfte"
    ),
    "Hidden Surfaces": "Verdeckte Flächen",
    (
        "Also render what moving objects hide, and what hides them, so that it is really there when they "
        "move away. Frames with moving objects take up to three times as long"
    ): (
        "Auch rendern, was bewegte Objekte verdecken und was sie verdeckt, damit es wirklich da ist, wenn "
        "sie sich wegbewegen. Bilder mit bewegten Objekten dauern bis zu dreimal so lange"
    ),
    "Depth Peeling": "Tiefenschichten",
    (
        "Also render what near things hide, which the lens sees past their blurred edges. Each further view "
        "takes about as long as the picture"
    ): (
        "Auch rendern, was nahe Dinge verdecken und das Objektiv an deren unscharfen Rändern vorbei sieht. "
        "Jede weitere Ansicht dauert etwa so lange wie das Bild"
    ),
    "Off": "Aus",
    "What near things hide is not rendered": "Was nahe Dinge verdecken, wird nicht gerendert",
    "Automatic": "Automatisch",
    (
        "Leave out what is nearest, parted where circles of confusion differ most; what is farthest, large "
        "as the ground, or around the camera stays"
    ): (
        "Das Nächste weglassen, getrennt, wo Zerstreuungskreise sich am stärksten unterscheiden; was am "
        "fernsten, groß wie der Boden oder rings um die Kamera ist, bleibt"
    ),
    "Collections": "Sammlungen",
    "Leave out one collection marked Peel Off after the other": (
        "Eine Sammlung nach der anderen weglassen, die mit „Abschälen“ markiert ist"
    ),
    "Layers": "Ebenen",
    "How many further views there may be, each without more of what is near": (
        "Wie viele weitere Ansichten es geben darf, jede ohne mehr von dem, was nah ist"
    ),
    "Peel Off": "Abschälen",
    (
        "Render a view without this collection, and without what is marked and nearer, for what its objects "
        "hide, where Depth Peeling is set to Collections"
    ): (
        "Eine Ansicht ohne diese Sammlung und ohne das, was markiert und näher ist, rendern, für das, was "
        "ihre Objekte verdecken, wenn „Tiefenschichten“ auf „Sammlungen“ steht"
    ),
    "No collection is marked Peel Off, in its own properties.": (
        "Keine Sammlung ist in ihren Eigenschaften mit „Abschälen“ markiert."
    ),
    "Reflections": "Spiegelungen",
    (
        "Focus and move what mirrors and glass show apart from the surfaces that show it. Probes of one "
        "sample a pixel find how far it is and how it moves"
    ): (
        "Was Spiegel und Glas zeigen, getrennt von den Flächen fokussieren und bewegen, die es zeigen. "
        "Sonden mit einem Abtastwert je Pixel finden, wie fern es ist und wie es sich bewegt"
    ),
    "What mirrors and glass show is focused and moves as their surfaces do": (
        "Was Spiegel und Glas zeigen, wird fokussiert und bewegt sich wie ihre Flächen"
    ),
    (
        "What mirrors and glass show is focused by its distance along the path of the light, and moves by "
        "itself"
    ): (
        "Was Spiegel und Glas zeigen, wird nach seiner Distanz entlang des Lichtwegs fokussiert und bewegt "
        "sich für sich"
    ),
    "Reflections and Shadows": "Spiegelungen und Schatten",
    (
        "Shadows of moving objects move, too. Frames with moving objects need the views of Hidden Surfaces "
        "and one more"
    ): (
        "Auch die Schatten bewegter Objekte bewegen sich. Bilder mit bewegten Objekten brauchen die "
        "Ansichten von „Verdeckte Flächen“ und eine weitere"
    ),
    "Roughness Limit": "Rauheitsgrenze",
    (
        "Objects whose materials are rougher than this do not count as mirrors or glass: what they show "
        "keeps the depth of their surface"
    ): (
        "Objekte mit raueren Materialien gelten nicht als Spiegel oder Glas: Was sie zeigen, behält die "
        "Tiefe ihrer Oberfläche"
    ),
    "No material is a mirror, glass or polished within the limit.": (
        "Kein Material ist innerhalb der Grenze ein Spiegel, Glas oder poliert."
    ),
    "Up to {full} Renders": "Bis zu {full} Renderings",
    "Up to {full} Renders and {probes} Probes": "Bis zu {full} Renderings und {probes} Sonden",
    "1 Render and {probes} Probes": "1 Rendering und {probes} Sonden",
    "Surface": "Oberfläche",
    "What light does at this object, where Reflections is on": (
        "Was Licht an diesem Objekt tut, wenn „Spiegelungen“ eingeschaltet ist"
    ),
    "As Material": "Wie Material",
    "As the object's materials say": "Wie die Materialien des Objekts es sagen",
    "Opaque": "Undurchsichtig",
    "Its surface is what is seen: nothing is followed further": (
        "Zu sehen ist seine Oberfläche: Nichts wird weiter verfolgt"
    ),
    "Polished": "Poliert",
    (
        "A clear coat over something opaque: it reflects where it is seen directly, and ends a path of light "
        "that comes from another mirror"
    ): (
        "Ein Klarlack über etwas Undurchsichtigem: Es spiegelt, wo es direkt zu sehen ist, und beendet einen "
        "Lichtweg, der von einem anderen Spiegel kommt"
    ),
    "Mirror": "Spiegel",
    "Metal: it always reflects": "Metall: Es spiegelt immer",
    "Glass": "Glas",
    "It lets light through and bends it, and reflects where it is seen directly": (
        "Es lässt Licht durch und bricht es, und spiegelt, wo es direkt zu sehen ist"
    ),
    "Clear": "Klar",
    "Light goes straight through": "Licht geht geradewegs hindurch",
    "As Material: Opaque": "Wie Material: Undurchsichtig",
    "As Material: Polished": "Wie Material: Poliert",
    "As Material: Mirror": "Wie Material: Spiegel",
    "As Material: Glass": "Wie Material: Glas",
    "As Material: Clear": "Wie Material: Klar",
    "As Material: Differs by Slot": "Wie Material: je Slot verschieden",
    "Show Quality Maps": "Qualitätskarten anzeigen",
    (
        "Let Process also make the images Potmesil Error, how far each pixel is expected to be off, and "
        "Potmesil Guessed, how much of its light was guessed"
    ): (
        "„Verarbeiten“ legt auch die Bilder Potmesil Error, wie weit jeder Pixel voraussichtlich abweicht, "
        "und Potmesil Guessed, wie viel von seinem Licht geschätzt ist, an"
    ),
    "Where the samples of a frame are kept; # stands for the frame number": (
        "Wo die Abtastwerte eines Bildes aufbewahrt werden; # steht für die Bildnummer"
    ),
    # Fixes.
    "Fix": "Beheben",
    "Put a finding of the check right": "Einen Befund der Prüfung beheben",
    "Fix All": "Alles beheben",
    "Put right all that keeps the scene from rendering well; notes are left as they are": (
        "Alles beheben, was gutem Rendern der Szene im Weg steht; Hinweise bleiben, wie sie sind"
    ),
    "What to do": "Was zu tun ist",
    "Add Camera": "Kamera hinzufügen",
    "Add a camera that sees what the viewport shows, focused on its middle, and make it active": (
        "Eine Kamera hinzufügen, die sieht, was die 3D-Ansicht zeigt, auf deren Mitte fokussieren und sie "
        "aktivieren"
    ),
    "Make Active": "Aktivieren",
    "Render with the selected camera, or the first one by name": (
        "Mit der ausgewählten Kamera rendern, oder mit der ersten nach dem Namen"
    ),
    "Make Perspective": "Perspektivisch machen",
    "Make the camera a perspective one": "Die Kamera zu einer perspektivischen machen",
    "Use Cycles": "Cycles verwenden",
    "Render with Cycles, which gives all passes": "Mit Cycles rendern, das alle Durchgänge liefert",
    "Use View Layer": "Ansichtsebene verwenden",
    "Use the active view layer for rendering": "Die aktive Ansichtsebene zum Rendern verwenden",
    "Enable the passes, and give every object a pass index of its own": (
        "Die Durchgänge einschalten und jedem Objekt einen eigenen Durchgangsindex geben"
    ),
    "Focus on Middle": "Auf Mitte fokussieren",
    "Focus on what the middle of the picture shows": "Auf das fokussieren, was die Bildmitte zeigt",
    "Open Aperture": "Blende öffnen",
    "Lower the f-stop until the farthest is blurred by a hundredth of the picture's longer side": (
        "Die Blendenzahl senken, bis das Fernste um ein Hundertstel der längeren Bildseite unscharf ist"
    ),
    "Turn Off": "Ausschalten",
    "Turn On": "Einschalten",
    "Turn the engine's own motion blur off": "Die eigene Bewegungsunschärfe der Engine ausschalten",
    "Turn the camera's own depth of field off": "Die eigene Schärfentiefe der Kamera ausschalten",
    "Turn the denoising of renders off": "Die Rauschreduzierung beim Rendern ausschalten",
    "Set the clamping of light to 0, which is off": (
        "Die Begrenzung des Lichts auf 0 setzen, also ausschalten"
    ),
    "Focus and move what mirrors and glass show apart from their surfaces": (
        "Was Spiegel und Glas zeigen, getrennt von ihren Flächen fokussieren und bewegen"
    ),
    "Do not look for mirrors and glass": "Nicht nach Spiegeln und Glas suchen",
    "Turn the motion processor on": "Den Bewegungsprozessor einschalten",
    "Render the camera's own view alone": "Nur die eigene Ansicht der Kamera rendern",
    "Render the whole picture": "Das ganze Bild rendern",
    "Let renders run the compositor": "Beim Rendern den Kompositor ausführen",
    "Keep the window from drawing the scene while a render goes on": (
        "Das Fenster davon abhalten, die Szene während des Renderns zu zeichnen"
    ),
    "Beside the File": "Neben die Datei",
    "Keep samples beside the .blend file": "Abtastwerte neben der .blend-Datei aufbewahren",
    "Number Them": "Nummerieren",
    "Put the frame's number into the samples path": (
        "Die Nummer des Bildes in den Pfad der Abtastwerte aufnehmen"
    ),
    "Save As...": "Speichern unter...",
    "Choose where to save the file": "Wählen, wohin die Datei gespeichert wird",
    "'{name}' is linked from another file; make it local, or a library override.": (
        "'{name}' ist aus einer anderen Datei verknüpft; es lokal machen oder als Bibliothek überschreiben."
    ),
    "{label} of '{name}' is animated; change its keys or its driver instead.": (
        "{label} von '{name}' ist animiert; stattdessen die Schlüsselbilder oder den Treiber ändern."
    ),
    "The scene '{name}' is linked from another file; make it local first.": (
        "Die Szene '{name}' ist aus einer anderen Datei verknüpft; sie zuerst lokal machen."
    ),
    "This Blender has no Cycles; enable its add-on in the preferences.": (
        "Dieses Blender hat kein Cycles; dessen Add-on in den Einstellungen einschalten."
    ),
    "The file was never saved, or cannot be where it is; save it first.": (
        "Die Datei wurde nie gespeichert oder kann es dort nicht werden, wo sie ist; sie zuerst speichern."
    ),
    # Findings of the check.
    "No Active Camera": "Keine aktive Kamera",
    "The scene has no camera that is active; make one active.": (
        "Keine Kamera der Szene ist aktiv; eine aktivieren."
    ),
    "No Camera": "Keine Kamera",
    "The scene has no camera; add one and make it active.": (
        "Die Szene hat keine Kamera; eine hinzufügen und aktivieren."
    ),
    "Panoramic Camera": "Panoramakamera",
    "A panoramic camera's Z is a distance and no depth; use a perspective camera.": (
        "Z ist bei einer Panoramakamera ein Abstand und keine Tiefe; eine perspektivische Kamera verwenden."
    ),
    "No Perspective Camera": "Keine perspektivische Kamera",
    "Only a perspective camera has a lens in front of a film; choose that type.": (
        "Nur eine perspektivische Kamera hat ein Objektiv vor einem Film; diesen Typ wählen."
    ),
    "Camera Is Linked": "Kamera ist verknüpft",
    "The camera is linked from another file; make it local, or a library override, to change it.": (
        "Die Kamera ist aus einer anderen Datei verknüpft; sie lokal machen oder als Bibliothek "
        "überschreiben, um sie zu ändern."
    ),
    "Engine Without Passes": "Engine ohne Durchgänge",
    "This render engine gives no Z pass; use Cycles.": (
        "Diese Render-Engine liefert keinen Z-Durchgang; Cycles verwenden."
    ),
    "No View Layer": "Keine Ansichtsebene",
    "No view layer is used for rendering; switch one on.": (
        "Keine Ansichtsebene wird zum Rendern verwendet; eine einschalten."
    ),
    "Samples Cannot Be Kept": "Abtastwerte nicht speicherbar",
    "Not Cycles": "Nicht Cycles",
    "Only Cycles gives all passes; others lack the object index.": (
        "Nur Cycles liefert alle Durchgänge; anderen fehlt der Objekt-Index."
    ),
    "Render switches them on for itself; Set Up Passes keeps them on for every render.": (
        "„Rendern“ schaltet sie für sich ein; „Durchgänge einrichten“ lässt sie für jedes Rendern an."
    ),
    "Focus Distance Is 0": "Fokusdistanz ist 0",
    "Everything is blurred beyond recognition; set the focus distance or a focus object.": (
        "Alles ist bis zur Unkenntlichkeit unscharf; die Fokusdistanz einstellen oder ein Fokusobjekt wählen."
    ),
    "Motion Blur On": "Bewegungsunschärfe an",
    "With it the vector pass is all zero; Render switches it off while it works.": (
        "Mit ihr ist der Vektor-Durchgang überall null; „Rendern“ schaltet sie ab, während es arbeitet."
    ),
    "Objects Share Index 0": "Objekte teilen Index 0",
    "Samples cannot tell one object from another; Set Up Passes gives each an index.": (
        "Abtastwerte können Objekte nicht unterscheiden; „Durchgänge einrichten“ gibt jedem einen Index."
    ),
    "Stereo Views": "Stereoansichten",
    "Only the camera's own view is rendered; render the others one by one.": (
        "Nur die eigene Ansicht der Kamera wird gerendert; die anderen einzeln rendern."
    ),
    "Compositing Off": "Compositing aus",
    "The compositor has a stage and does not run; turn Compositing on.": (
        "Der Kompositor hat eine Stufe und läuft nicht; „Compositing“ einschalten."
    ),
    "Interface Not Locked": "Interface nicht gesperrt",
    "Renders with a stage follow what moves; turn Render > Lock Interface on.": (
        "Rendern mit einer Stufe verfolgt, was sich bewegt; „Rendern“ > „Interface sperren“ einschalten."
    ),
    "Render Region": "Renderbereich",
    "Only the region is rendered, and its blurred edges miss what lies outside; turn it off.": (
        "Nur der Bereich wird gerendert, und seinen unscharfen Rändern fehlt, was außerhalb liegt; ihn "
        "ausschalten."
    ),
    "Camera Blurs Already": "Kamera zeichnet schon unscharf",
    "The camera's own depth of field is on; Render switches it off while it works.": (
        "Die eigene Schärfentiefe der Kamera ist an; „Rendern“ schaltet sie ab, während es arbeitet."
    ),
    "Hardly Anything Is Blurred": "Kaum etwas ist unscharf",
    "From half of the focus distance on, all is sharp to a pixel; choose a lower f-stop.": (
        "Ab der halben Fokusdistanz ist alles auf einen Pixel scharf; eine kleinere Blendenzahl wählen."
    ),
    "Denoising On": "Rauschreduzierung an",
    "Denoised colors can lie across depth edges; more samples are safer where edges show.": (
        "Entrauschte Farben können über Tiefenkanten hinweg liegen; mehr Abtastwerte sind sicherer, wo man "
        "Kanten sieht."
    ),
    "Samples Clamped": "Abtastwerte begrenzt",
    "Clamping dims highlights, and with them the discs they blur into; set it to 0.": (
        "Begrenzen dunkelt Lichter ab und mit ihnen ihre Unschärfescheiben; auf 0 setzen."
    ),
    "Reflections Without Cycles": "Spiegelungen ohne Cycles",
    "Only Cycles tells what mirrors and glass show; use it, or turn Reflections off.": (
        "Nur Cycles sagt, was Spiegel und Glas zeigen; es verwenden oder „Spiegelungen“ ausschalten."
    ),
    "Nothing Reflects": "Nichts spiegelt",
    "No material is smooth enough; raise the Roughness Limit, or turn Reflections off.": (
        "Kein Material ist glatt genug; die Rauheitsgrenze anheben oder „Spiegelungen“ ausschalten."
    ),
    "Reflections Off": "Spiegelungen aus",
    "What mirrors and glass show is blurred as their surfaces are; turn Reflections on.": (
        "Was Spiegel und Glas zeigen, wird unscharf wie ihre Flächen; „Spiegelungen“ einschalten."
    ),
    "Shadows Do Not Move": "Schatten bewegen sich nicht",
    "Shadows are moved by the motion processor alone, and it is off; turn it on.": (
        "Schatten bewegt nur der Bewegungsprozessor, und er ist aus; ihn einschalten."
    ),
    "One Samples File": "Eine Datei für alle Bilder",
    "Each frame's samples replace those of the frame before; put #### into the samples path.": (
        "Die Abtastwerte jedes Bildes ersetzen die des vorigen; #### in den Pfad der Abtastwerte aufnehmen."
    ),
    "File Not Saved": "Datei nicht gespeichert",
    (
        "Samples go into a folder that Blender empties when it ends; save the file to keep new ones beside "
        "it."
    ): (
        "Abtastwerte kommen in einen Ordner, den Blender beim Beenden leert; die Datei speichern, um neue "
        "neben ihr aufzubewahren."
    ),
    # Errors.
    (
        "Frames are written as images and not as a movie; choose an image format in the output properties, "
        "or add a stage."
    ): (
        "Bilder werden einzeln und nicht als Film geschrieben; in den Ausgabeeigenschaften ein Bildformat "
        "wählen oder eine Stufe hinzufügen."
    ),
    (
        "The picture has one layer; choose OpenEXR, not OpenEXR MultiLayer, in the output properties, or add "
        "a stage."
    ): (
        "Das Bild hat eine Ebene; in den Ausgabeeigenschaften OpenEXR statt OpenEXR MultiLayer wählen oder "
        "eine Stufe hinzufügen."
    ),
    (
        "The output path is relative to a .blend file that was never saved; save the file, or choose another "
        "output path."
    ): (
        "Der Ausgabepfad ist relativ zu einer .blend-Datei, die nie gespeichert wurde; die Datei speichern "
        "oder einen anderen Ausgabepfad wählen."
    ),
    "The output path is not valid: {reason} Correct it in the output properties.": (
        "Der Ausgabepfad ist ungültig: {reason} In den Ausgabeeigenschaften berichtigen."
    ),
    "Cannot write frames into '{folder}'; choose another output path.": (
        "Bilder lassen sich nicht nach '{folder}' schreiben; einen anderen Ausgabepfad wählen."
    ),
    "Cannot write '{path}': {reason}; check the folder and the disk.": (
        "'{path}' lässt sich nicht schreiben: {reason}; Ordner und Datenträger prüfen."
    ),
    "Frame {frame}: {error}": "Bild {frame}: {error}",
    "All frames have the same samples file; put #### into the samples path, and render again.": (
        "Alle Bilder haben dieselbe Datei für Abtastwerte; #### in den Pfad der Abtastwerte aufnehmen und "
        "neu rendern."
    ),
    "There is no render to save; render the scene first.": (
        "Es gibt kein gerendertes Bild zu speichern; zuerst die Szene rendern."
    ),
    "Blender cannot save the render ({reason}); render again.": (
        "Blender kann das gerenderte Bild nicht speichern ({reason}); neu rendern."
    ),
    "Blender could not render: {reason}": "Blender konnte nicht rendern: {reason}",
    "Blender did not start the render; end other renders and try again.": (
        "Blender hat das Rendern nicht begonnen; anderes Rendern beenden und erneut versuchen."
    ),
    "The sensor's size is unknown; give its width or its height.": (
        "Die Größe des Sensors ist unbekannt; seine Breite oder Höhe angeben."
    ),
    "The camera's scale is 0; give the camera object a scale of 1.": (
        "Die Skalierung der Kamera ist 0; dem Kameraobjekt die Skalierung 1 geben."
    ),
    "The file's motion paths are damaged; export it again.": (
        "Die Bewegungspfade der Datei sind beschädigt; sie neu exportieren."
    ),
    "The file's lamps are damaged; export it again.": (
        "Die Lampen der Datei sind beschädigt; sie neu exportieren."
    ),
    "The shutter's curve is 0 all the time it is open; raise it.": (
        "Die Verschlusskurve ist 0, solange der Verschluss offen ist; sie anheben."
    ),
    (
        "Lommel's diffraction pattern is that of a round, clear and perfect aperture; set the blades to 0 "
        "and leave out what shapes the aperture, or choose the disc PSF."
    ): (
        "Lommels Beugungsmuster ist das einer runden, freien und vollkommenen Blende; die Lamellen auf 0 "
        "setzen und weglassen, was die Blende formt, oder „Geometrisch“ wählen."
    ),
    (
        "Between the shapes that mechanical vignetting cuts nothing is interpolated; choose the nearest "
        "table."
    ): (
        "Zwischen den Formen, die die mechanische Vignettierung schneidet, wird nicht interpoliert; die "
        "nächste Tabelle wählen."
    ),
    (
        "Tables at equal steps of depth are for a lens that is sharp at one depth all over; choose tables at "
        "equal steps of the circle."
    ): (
        "Tabellen in gleichen Schritten der Tiefe sind für ein Objektiv, das überall in einer Tiefe scharf "
        "ist; Tabellen in gleichen Schritten des Zerstreuungskreises wählen."
    ),
    "The barrel covers all of the aperture in the corners; lower its vignetting.": (
        "Die Fassung verdeckt in den Ecken die ganze Blende; ihre Vignettierung verringern."
    ),
    (
        "The nearest and the farthest sample lie too many steps of tables apart; use a larger step between "
        "them or tables at equal steps of the circle."
    ): (
        "Der nächste und der fernste Abtastwert liegen zu viele Tabellenschritte auseinander; einen größeren "
        "Schritt oder Tabellen in gleichen Schritten des Kreises verwenden."
    ),
    "Exposures must follow each other without overlap, each from its begin to a later end.": (
        "Belichtungen müssen ohne Überschneidung aufeinander folgen, jede von ihrem Beginn zu einem späteren "
        "Ende."
    ),
    "A shutter curve needs two or more points in order of time, with times and openness from 0 to 1.": (
        "Eine Verschlusskurve braucht zwei oder mehr Punkte in zeitlicher Reihenfolge, mit Zeiten und "
        "Öffnungen von 0 bis 1."
    ),
    "A motion path has a time or place that is no number; check the animation.": (
        "Ein Bewegungspfad hat eine Zeit oder einen Ort, der keine Zahl ist; die Animation prüfen."
    ),
    "A motion path has a place or light that is no number; check the animation.": (
        "Ein Bewegungspfad hat einen Ort oder ein Licht, das keine Zahl ist; die Animation prüfen."
    ),
    "A motion path needs one place (x, y) for each of its times, and a time.": (
        "Ein Bewegungspfad braucht einen Ort (x, y) für jede seiner Zeiten, und eine Zeit."
    ),
    "A motion path needs one share of light for each of its pieces, and a piece.": (
        "Ein Bewegungspfad braucht einen Anteil Licht für jedes seiner Stücke, und ein Stück."
    ),
    "The times of a motion path must increase.": "Die Zeiten eines Bewegungspfads müssen zunehmen.",
    "The light along a motion path must be 0 or more, and not 0 everywhere.": (
        "Das Licht entlang eines Bewegungspfads muss 0 oder mehr sein, und nicht überall 0."
    ),
    (
        "This motion is neither level nor upright, so its point-spread function is no product of two; choose "
        "the spatial or frequency method."
    ): (
        "Diese Bewegung ist weder waagerecht noch senkrecht, daher ist ihre Punktspreizfunktion kein Produkt "
        "aus zweien; die räumliche oder die Frequenzmethode wählen."
    ),
    "Wavelengths must be greater than 0.": "Wellenlängen müssen größer als 0 sein.",
    "A shutter curve is a JSON list of [time, openness] pairs such as [[0, 0], [0.5, 1], [1, 0]].": (
        "Eine Verschlusskurve ist eine JSON-Liste von Paaren [Zeit, Öffnung] wie [[0, 0], [0.5, 1], [1, 0]]."
    ),
    "All frames are there; turn Overwrite on in the output properties to make them again.": (
        "Alle Bilder sind da; in den Ausgabeeigenschaften „Überschreiben“ einschalten, um sie neu zu machen."
    ),
}
